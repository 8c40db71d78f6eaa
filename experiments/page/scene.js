// SPDX-License-Identifier: GPL-3.0-or-later
// A layout in its scene: flat shaded triangles whose backs are left out, so that one sees into
// rooms, and probes as balls in the colour of their state or of a number. Plain WebGL.

// Colours of states that colour-blind readers tell apart (Okabe and Ito).
const probeStates = [
  {name: 'active', color: [0, 158, 115]},
  {name: 'off', color: [140, 140, 140]},
  {name: 'inside solid geometry', color: [213, 94, 0]}];
const noValueColor = [110, 110, 110], pickedColor = [255, 0, 160];
const manyProbes = 4000;  // more than that are drawn as octahedra

class SceneView {
  constructor(layout) {
    this.layout = layout;
    this.positions = blobFloats(layout.probes.positions);
    this.states = blobBytes(layout.probes.states);
    this.values = layout.probes.values.map((value) => ({...value, data: blobFloats(value.blob)}));
    const {min, max} = layout.box;
    this.diagonal = Math.hypot(...vec.sub(max, min)) || 1;
    this.radius = Math.min(layout.probes.radius_m, this.diagonal / 40);
    this.options = {scene: true, probes: true, through: false, cull: true, size: 1, color: 'state',
                    cut: this.startingCut()};
    this.shownStates = [true, true, true];
    this.picked = -1;
    this.camera = new OrbitCamera(layout.box);
  }

  // Heights are cut off above all probes: that takes away the ceiling over them.
  startingCut() {
    let most = -Infinity;
    for (let i = 1; i < this.positions.length; i += 3) most = Math.max(most, this.positions[i]);
    const {min, max} = this.layout.box, cut = (most + this.radius - min[1]) / (max[1] - min[1]);
    return Number.isFinite(cut) ? Math.min(1, Math.ceil(100 * cut) / 100) : 1;
  }

  cutHeight() {
    const {min, max} = this.layout.box;
    return this.options.cut >= 1 ? 1e30 : min[1] + this.options.cut * (max[1] - min[1]);
  }

  // Buffers.

  build() {
    this.canvas = element('canvas', {class: 'view space', tabindex: '0', role: 'img',
                                     id: 'scene-canvas',
                                     'aria-label': 'probes in the scene; arrows orbit, shift and ' +
                                                   'arrows pan, + and - zoom, 0 resets'});
    this.info = element('div', {class: 'probe-info', 'aria-live': 'polite'});
    this.legend = element('div', {class: 'probe-legend'});
    this.node = element('div', {},
                        this.facts(), this.controls(),
                        element('div', {class: 'beside'}, this.canvas,
                                element('div', {}, this.legend, this.info)),
                        element('p', {class: 'quiet'}, 'Dragging orbits; with shift or the right ' +
                                'button it pans. Click, then the wheel or +/- zooms; arrows ' +
                                'orbit, shift and arrows pan, 0 resets.'));
    this.gl = this.canvas.getContext('webgl', {antialias: true, preserveDrawingBuffer: true});
    this.fillLegend();
    if (!this.gl) {
      this.canvas.replaceWith(element('p', {class: 'notice'}, 'This browser has no WebGL, so the ' +
                                      '3D view is left out; switch on hardware acceleration or ' +
                                      'use another browser.'));
      return this.node;
    }
    this.program = {scene: this.link(sceneVertexShader), probes: this.link(probeVertexShader)};
    this.makeTriangles();
    this.makeProbes();
    this.listen();
    return this.node;
  }

  link(vertexShader) {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertexShader],
                                [gl.FRAGMENT_SHADER, fragmentShader]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ['position', 'normal', 'color'].forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      throw Error(gl.getProgramInfoLog(program));
    return program;
  }

  buffer(data) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  }

  makeTriangles() {
    const {triangles} = this.layout;
    const positions = blobFloats(triangles.positions), colors = blobBytes(triangles.colors);
    const normals = new Float32Array(positions.length), shades = new Uint8Array(positions.length);
    for (let t = 0; t < triangles.shown; ++t) {
      const corner = (k) => Array.from(positions.subarray(9 * t + 3 * k, 9 * t + 3 * k + 3));
      const [a, b, c] = [corner(0), corner(1), corner(2)];
      const normal = vec.unit(vec.cross(vec.sub(b, a), vec.sub(c, a)));
      for (let k = 0; k < 3; ++k) {
        normals.set(normal, 9 * t + 3 * k);
        shades.set(colors.subarray(3 * t, 3 * t + 3), 9 * t + 3 * k);
      }
    }
    this.triangleBuffers = [positions, normals, shades].map((data) => this.buffer(data));
  }

  makeProbes() {
    this.ball = ballTriangles(this.layout.probes.count > manyProbes ? 0 : 1);
    const corners = this.ball.length, count = this.layout.probes.count;
    const centers = new Float32Array(3 * corners * count);
    const normals = new Float32Array(centers.length);
    for (let i = 0; i < count; ++i)
      for (let k = 0; k < corners; ++k) {
        centers.set(this.positions.subarray(3 * i, 3 * i + 3), 3 * (i * corners + k));
        normals.set(this.ball[k], 3 * (i * corners + k));
      }
    this.probeBuffers = [centers, normals, new Uint8Array(centers.length)].map(
      (data) => this.buffer(data));
    this.colorProbes();
  }

  // Probes that are not shown have no triangles that are drawn: their runs are left out.
  colorProbes() {
    if (!this.gl) return;
    const gl = this.gl, corners = this.ball.length, count = this.layout.probes.count;
    const colors = new Uint8Array(3 * corners * count);
    this.runs = [];
    for (let i = 0; i < count; ++i) {
      const color = i === this.picked ? pickedColor : this.colorOf(i);
      for (let k = 0; k < corners; ++k) colors.set(color, 3 * (i * corners + k));
      if (!this.shownStates[this.states[i]]) continue;
      const last = this.runs[this.runs.length - 1];
      if (last && last[1] === i) last[1] = i + 1;
      else this.runs.push([i, i + 1]);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.probeBuffers[2]);
    gl.bufferData(gl.ARRAY_BUFFER, colors, gl.STATIC_DRAW);
  }

  chosenValues() { return this.values.find((value) => value.name === this.options.color); }

  colorOf(i) {
    const value = this.chosenValues();
    if (!value) return probeStates[this.states[i]].color;
    const [least, most] = this.range(value), t = (value.data[i] - least) / (most - least || 1);
    if (!Number.isFinite(t)) return noValueColor;
    const at = 3 * Math.round(255 * t);
    return [falseTable[at], falseTable[at + 1], falseTable[at + 2]];
  }

  range(value) {
    if (!value.range) {
      const finite = value.data.filter(Number.isFinite).sort();
      value.range = finite.length ? [finite[0], finite[finite.length - 1]] : [0, 1];
    }
    return value.range;
  }

  // Drawing.

  draw() {
    if (!this.gl) return;
    const gl = this.gl, canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height)
      canvas.width = width, canvas.height = height;
    gl.viewport(0, 0, width, height);
    const ground = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g).map(Number);
    gl.clearColor(ground[0] / 255, ground[1] / 255, ground[2] / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    this.projection = this.camera.projection(width / height);
    if (this.options.scene) this.drawTriangles();
    if (this.options.probes) this.drawProbes();
  }

  bind(program, buffers) {
    const gl = this.gl;
    gl.useProgram(program);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, 'matrix'), false, this.projection.columns);
    gl.uniform1f(gl.getUniformLocation(program, 'cut'), this.cutHeight());
    buffers.forEach((buffer, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, 3, i === 2 ? gl.UNSIGNED_BYTE : gl.FLOAT, i === 2, 0, 0);
    });
  }

  drawTriangles() {
    const gl = this.gl, {shown, one_sided} = this.layout.triangles;
    this.bind(this.program.scene, this.triangleBuffers);
    if (this.options.cull) gl.enable(gl.CULL_FACE);
    else gl.disable(gl.CULL_FACE);
    if (one_sided > 0) gl.drawArrays(gl.TRIANGLES, 0, 3 * one_sided);
    gl.disable(gl.CULL_FACE);
    if (shown > one_sided) gl.drawArrays(gl.TRIANGLES, 3 * one_sided, 3 * (shown - one_sided));
  }

  drawProbes() {
    const gl = this.gl, program = this.program.probes, corners = this.ball.length;
    this.bind(program, this.probeBuffers);
    gl.uniform1f(gl.getUniformLocation(program, 'radius'), this.radius * this.options.size);
    gl.uniform3fv(gl.getUniformLocation(program, 'eye'), this.projection.eye);
    gl.enable(gl.CULL_FACE);
    if (this.options.through) gl.clear(gl.DEPTH_BUFFER_BIT);
    for (const [begin, end] of this.runs)
      gl.drawArrays(gl.TRIANGLES, begin * corners, (end - begin) * corners);
  }

  // Controls.

  facts() {
    const {layout} = this, {triangles, probes} = layout;
    const shown = triangles.shown === triangles.all
      ? `${triangles.all} triangles`
      : `the ${triangles.shown} largest of ${triangles.all} triangles`;
    const list = element('dl', {class: 'facts'});
    const facts = [['scene', `${layout.scene}, ${shown}`],
                   ['layout', `${layout.strategy}, interpolant ${layout.interpolant}, ` +
                              `${probes.count} probes`]];
    for (const [name, value] of facts)
      list.append(element('dt', {}, name), element('dd', {}, value));
    return list;
  }

  controls() {
    const redraw = (name) => (on) => {
      this.options[name] = on;
      this.draw();
    };
    const choices = ['state', ...this.values.map((value) => value.name)];
    const select = element('select', {id: 'probe-color'}, ...choices.map(
      (name) => element('option', {value: name}, name)));
    select.addEventListener('change', () => {
      this.options.color = select.value;
      this.colorProbes();
      this.fillLegend();
      this.draw();
    });
    const size = element('input', {type: 'range', id: 'probe-size', min: -2, max: 2, step: 0.25,
                                   value: 0});
    size.addEventListener('input', () => redraw('size')(2 ** Number(size.value)));
    const cut = element('input', {type: 'range', id: 'cut', min: 0, max: 1, step: 0.01,
                                  value: this.options.cut});
    const height = element('output', {for: 'cut'});
    const showCut = () => {
      height.textContent = this.options.cut >= 1 ? 'none'
        : formatNumber(this.layout.origin[1] + this.cutHeight()) + ' m';
    };
    cut.addEventListener('input', () => {
      redraw('cut')(Number(cut.value));
      showCut();
    });
    showCut();
    return element('div', {class: 'controls'},
                   element('label', {for: 'probe-color'}, 'Colour by', select),
                   element('label', {for: 'probe-size'}, 'Size', size),
                   element('label', {for: 'cut'}, 'Cut above', cut, height),
                   checkbox('scene', 'show-scene', true, redraw('scene')),
                   checkbox('probes', 'show-probes', true, redraw('probes')),
                   checkbox('through walls', 'show-through', false, redraw('through')),
                   checkbox('leave out back faces', 'cull-faces', true, redraw('cull')),
                   element('button', {type: 'button', id: 'reset-camera', onclick: () => {
                     this.camera.reset();
                     this.draw();
                   }}, 'Reset view'),
                   element('button', {type: 'button', id: 'top-camera', onclick: () => {
                     this.camera.lookDown();
                     this.draw();
                   }}, 'From above'));
  }

  fillLegend() {
    const {counts, params, moved} = this.layout.probes, value = this.chosenValues();
    const list = probeStates.map((state, i) => {
      const swatch = element('span', {class: 'swatch'});
      swatch.style.background = value ? 'none' : `rgb(${state.color})`;
      const show = (on) => {
        this.shownStates[i] = on;
        this.colorProbes();
        this.draw();
      };
      const box = checkbox(`${state.name}: ${counts[i]}`, `state-${i}`, this.shownStates[i], show);
      box.insertBefore(swatch, box.lastChild);
      return element('div', {class: 'controls'}, box);
    });
    this.legend.replaceChildren(...list);
    this.legend.append(element('p', {class: 'quiet'}, params === null
      ? 'As the layout has them: none was moved or switched off (--params).'
      : `As ${params} relocates and classifies them: ${moved} moved.`));
    if (!value) return;
    const [least, most] = this.range(value), unit = value.unit ? ' ' + value.unit : '';
    this.legend.append(element('p', {}, `${value.name}${value.unit ? ` [${value.unit}]` : ''}: `,
                               element('span', {class: 'quiet'}, value.about)),
                       legendBar(falseTable, formatNumber(least) + unit,
                                 formatNumber((least + most) / 2), formatNumber(most) + unit));
  }

  fillInfo() {
    if (this.picked < 0) {
      this.info.replaceChildren();
      return;
    }
    const i = this.picked, place = [0, 1, 2].map(
      (c) => (this.layout.origin[c] + this.positions[3 * i + c]).toFixed(3)).join(', ');
    const list = element('dl', {class: 'facts'});
    const facts = [['position', `${place} m`], ['state', probeStates[this.states[i]].name],
                   ...this.values.map((v) => [v.name, `${formatNumber(v.data[i])} ${v.unit}`])];
    for (const [name, text] of facts) list.append(element('dt', {}, name), element('dd', {}, text));
    this.info.replaceChildren(element('h3', {}, `Probe ${i}`), list);
  }

  // Pointer and keys.

  // The nearest probe to the eye that is drawn at this place of the canvas, -1: none.
  probeAt(event) {
    if (!this.options.probes || !this.projection) return -1;
    const box = this.canvas.getBoundingClientRect(), {rows} = this.projection;
    const x = 2 * (event.clientX - box.left) / box.width - 1;
    const y = 1 - 2 * (event.clientY - box.top) / box.height;
    const aspect = box.width / box.height;
    let found = -1, nearest = Infinity;
    for (let i = 0; i < this.layout.probes.count; ++i) {
      const cut = this.positions[3 * i + 1] > this.cutHeight();
      if (cut || !this.shownStates[this.states[i]]) continue;
      const p = [...this.positions.subarray(3 * i, 3 * i + 3), 1];
      const [u, v, , w] = rows.map((row) => row.reduce((sum, r, c) => sum + r * p[c], 0));
      if (w <= 0 || w >= nearest) continue;
      const reach = Math.max(cameraFocal * this.radius * this.options.size / w, 8 / box.height);
      if (Math.hypot((u / w - x) * aspect, v / w - y) <= reach) found = i, nearest = w;
    }
    return found;
  }

  listen() {
    const canvas = this.canvas;
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.drag = {x: event.clientX, y: event.clientY, moved: false,
                   pan: event.shiftKey || event.button === 2};
    });
    canvas.addEventListener('pointermove', (event) => this.move(event));
    canvas.addEventListener('pointerup', (event) => {
      if (this.drag && !this.drag.moved) this.pick(this.probeAt(event));
      this.drag = null;
    });
    canvas.addEventListener('dblclick', () => {
      this.camera.reset();
      this.draw();
    });
    canvas.addEventListener('wheel', (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.camera.zoom(2 ** (event.deltaY / 400));
      this.draw();
    }, {passive: false});
    canvas.addEventListener('keydown', (event) => this.key(event));
  }

  pick(i) {
    this.picked = i;
    this.colorProbes();
    this.fillInfo();
    this.draw();
  }

  move(event) {
    if (!this.drag) return;
    const dx = event.clientX - this.drag.x, dy = event.clientY - this.drag.y;
    if (!this.drag.moved && Math.hypot(dx, dy) < 3) return;
    Object.assign(this.drag, {x: event.clientX, y: event.clientY, moved: true});
    const height = this.canvas.clientHeight;
    if (this.drag.pan) this.camera.pan(dx / height, dy / height);
    else this.camera.orbit(-dx * 0.008, dy * 0.008);
    this.draw();
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    const arrow = arrows[event.key], camera = this.camera;
    if (arrow && event.shiftKey) camera.pan(-0.05 * arrow[0], -0.05 * arrow[1]);
    else if (arrow) camera.orbit(0.1 * arrow[0], -0.1 * arrow[1]);
    else if (event.key === '+' || event.key === '=') camera.zoom(0.85);
    else if (event.key === '-') camera.zoom(1 / 0.85);
    else if (event.key === '0') camera.reset();
    else return;
    this.draw();
    event.preventDefault();
  }
}

function buildScene() {
  if (!report.layout) return;
  const view = new SceneView(report.layout), node = section('layout', 'Layout');
  node.append(view.build());
  view.draw();
}
