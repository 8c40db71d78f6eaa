// SPDX-License-Identifier: GPL-3.0-or-later
// The image comparer: images of one size, by flipping, split or side by side, under one exposure;
// their signed error against the reference; false colour; the values of a pixel.

class Comparer {
  constructor(set, index) {
    this.set = set;
    this.index = index;
    this.colors = new ImageColors(set);
    this.images = this.colors.images;
    this.count = set.width * set.height;
    this.layout = 'flip';
    this.show = 'tone';
    this.exposure = set.exposure;
    const other = this.images.findIndex((image, i) => i !== set.reference);
    this.a = set.reference;  // flip shows a; split a on the left
    this.b = other < 0 ? set.reference : other;
    this.split = 0.5;
    this.resetView();
    this.pixel = null;
    this.errorScale = this.autoErrorScale = this.colors.suggestErrorScale();
    this.falseMost = this.autoFalseMost = this.colors.suggestFalseMost();
    this.pictures = new Map();
    this.panes = [];
  }

  resetView() { this.view = {zoom: 1, x: this.set.width / 2, y: this.set.height / 2}; }

  // The image as it is shown, in its own size; kept until a control changes its colours.
  picture(k) {
    if (!this.pictures.has(k)) {
      const canvas = element('canvas', {width: this.set.width, height: this.set.height});
      const context = canvas.getContext('2d');
      const data = context.createImageData(this.set.width, this.set.height);
      this.colors.paint(k, this, data.data);
      context.putImageData(data, 0, 0);
      this.pictures.set(k, canvas);
    }
    return this.pictures.get(k);
  }

  recolor() {
    this.pictures.clear();
    this.draw();
  }

  // Panes.

  build() {
    this.place = element('div', {class: 'panes'});
    this.table = element('table', {class: 'pixel-values'});
    this.legend = element('div', {class: 'group legend-place'});
    this.node = element('div', {class: 'comparer', id: `comparer-${this.index}`},
                        ...this.controls(),
                        element('div', {class: 'workbench'}, this.place,
                                element('div', {class: 'side'}, this.legend, this.table)),
                        this.facts());
    this.node.addEventListener('keydown', (event) => this.key(event));
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.place);
    this.makePanes();
    this.update();
    return this.node;
  }

  facts() {
    const {width, height, precision, images} = this.set;
    const bytes = images.length * this.count * (precision === 'half' ? 6 : 12);
    const bad = this.images.filter((image) => image.notFinite > 0)
      .map((image) => `${image.name}: ${image.notFinite} pixels are not finite (magenta)`);
    return element('p', {class: 'quiet'}, [
      `${images.length} images of ${width} x ${height} as ${precision} floats, ` +
        formatBytes(bytes),
      precision === 'half' ? 'values to 1 in 2,048' : 'exact values', ...bad].join('; ') +
      '. Click an image, then: wheel or +/- zooms, dragging pans, arrows move the cursor, 0 or a ' +
      'double click fits, 1 to 9 choose an image, space swaps the two.');
  }

  controls() {
    const names = this.images.map((image, i) => [i, image.name, 'key ' + (i + 1)]);
    this.aButtons = choiceButtons('image', names, this.a, (i) => this.choose('a', i));
    this.bButtons = choiceButtons('second image', names, this.b, (i) => this.choose('b', i));
    this.aLabel = element('span', {});
    this.bGroup = element('div', {class: 'group'}, element('span', {}, 'Right'), this.bButtons);
    this.aGroup = element('div', {class: 'group'}, this.aLabel, this.aButtons);
    this.splitSlider = this.slider('split', 'Split', 0, 1, 0.005, this.split, (v) => {
      this.split = v;
      this.draw();
    });
    const layouts = [['flip', 'Flip'], ['split', 'Split'], ['grid', 'Side by side']];
    const shows = [['tone', 'Tone'], ['error', 'Signed error'], ['false', 'False colour']];
    return [
      element('div', {class: 'controls'},
              choiceButtons('arrangement', layouts, this.layout, (v) => {
                this.layout = v;
                this.makePanes();
                this.update();
              }), this.aGroup, this.bGroup, this.splitSlider.node,
              this.swapButton = element('button', {type: 'button', class: 'swap', title: 'space',
                                                   onclick: () => this.swap()}, 'Swap')),
      element('div', {class: 'controls'},
              choiceButtons('colours', shows, this.show, (v) => {
                this.show = v;
                this.pictures.clear();
                this.update();
              }), ...this.scales(),
              element('button', {type: 'button', class: 'fit', title: 'key 0', onclick: () => {
                this.resetView();
                this.draw();
              }}, 'Fit'))];
  }

  scales() {
    const stops = (v) => `${v > 0 ? '+' : ''}${formatNumber(v)} stops`;
    this.exposureSlider = this.slider('exposure', 'Exposure', -10, 10, 0.25, this.exposure, (v) => {
      this.exposure = v;
      this.update(true);
    }, stops);
    this.errorBox = this.scaleBox('error-scale', 'Full colour at \u00b1', 'errorScale',
                                  'autoErrorScale');
    this.falseBox = this.scaleBox('false-most', 'Full colour at', 'falseMost', 'autoFalseMost');
    return [this.exposureSlider.node, this.errorBox, this.falseBox];
  }

  slider(name, label, least, most, step, value, onChange, format = formatNumber) {
    const id = `${name}-${this.index}`;
    const input = element('input', {type: 'range', id, min: least, max: most, step, value});
    const output = element('output', {for: id}, format(value));
    input.addEventListener('input', () => {
      output.textContent = format(Number(input.value));
      onChange(Number(input.value));
    });
    const set = (v) => {
      input.value = v;
      output.textContent = format(v);
    };
    return {node: element('label', {for: id}, label, input, output), set};
  }

  scaleBox(name, label, field, auto) {
    const id = `${name}-${this.index}`;
    const input = element('input', {type: 'number', id, min: 0, step: 'any', value: this[field]});
    const set = (value) => {
      input.setAttribute('aria-invalid', String(!(value > 0)));
      if (!(value > 0)) return;
      this[field] = value;
      this.update(true);
    };
    input.addEventListener('input', () => set(Number(input.value)));
    const button = element('button', {type: 'button', title: '99 % of the pixels are below',
                                      onclick: () => {
                                        input.value = this[auto];
                                        set(this[auto]);
                                      }}, 'auto');
    return element('div', {class: 'group'}, element('label', {for: id}, label, input), button);
  }

  choose(which, i) {
    this[which] = i;
    this.update();
  }

  swap() {
    [this.a, this.b] = [this.b, this.a];
    this.aButtons.press(this.a);
    this.bButtons.press(this.b);
    this.update();
  }

  makePanes() {
    const count = this.layout === 'grid' ? this.images.length : 1;
    this.panes = [];
    for (let k = 0; k < count; ++k) this.panes.push(this.makePane(k));
    this.place.replaceChildren(...this.panes.map((pane) => pane.node));
    const columns = count === 1 ? 1 : count === 2 || count === 4 ? 2 : 3;
    this.place.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    // All of them fit into the window's height, up to two rows of them.
    const {width, height} = this.set, rows = Math.min(2, Math.ceil(count / columns));
    this.place.style.maxWidth =
      `min(100%, calc(${columns} * ${68 / rows}vh * ${width / height}))`;
  }

  makePane(k) {
    const canvas = element('canvas', {class: 'view', tabindex: '0', role: 'img'});
    canvas.style.aspectRatio = `${this.set.width} / ${this.set.height}`;
    const name = element('div', {class: 'name'});
    const pane = {k, canvas, name, node: element('div', {class: 'pane'}, name, canvas)};
    canvas.addEventListener('pointermove', (event) => this.move(pane, event));
    canvas.addEventListener('pointerdown', (event) => this.press(pane, event));
    canvas.addEventListener('pointerup', () => { this.drag = null; });
    canvas.addEventListener('pointercancel', () => { this.drag = null; });
    canvas.addEventListener('dblclick', () => {
      this.resetView();
      this.draw();
    });
    canvas.addEventListener('wheel', (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.zoomAt(this.toImage(pane, event), 2 ** (-event.deltaY / 300));
    }, {passive: false});
    return pane;
  }

  // What changes with the choices: labels, legend, which controls there are.
  update(recolor = false) {
    if (recolor) this.pictures.clear();
    const grid = this.layout === 'grid', split = this.layout === 'split';
    this.aGroup.hidden = this.swapButton.hidden = grid;
    this.aGroup.style.display = grid ? 'none' : '';
    this.bGroup.style.display = split ? '' : 'none';
    this.splitSlider.node.style.display = split ? '' : 'none';
    this.aLabel.textContent = split ? 'Left' : 'Image';
    this.exposureSlider.node.style.display = this.show === 'tone' ? '' : 'none';
    this.errorBox.style.display = this.show === 'error' ? '' : 'none';
    this.falseBox.style.display = this.show === 'false' ? '' : 'none';
    this.drawLegend();
    this.draw();
  }

  drawLegend() {
    const reference = this.images[this.set.reference].name;
    const parts = {
      tone: () => [`white from ${formatNumber(2 ** -this.exposure)} on, clipped; sRGB`],
      error: () => [legendBar(errorTable, '\u2212' + formatNumber(this.errorScale), '0',
                              '+' + formatNumber(this.errorScale)),
                    `luminance minus that of ${reference}: blue is too dark, red too bright`],
      false: () => [legendBar(falseTable, '0', formatNumber(this.falseMost / 2),
                              formatNumber(this.falseMost)), 'luminance']};
    this.legend.replaceChildren(...parts[this.show]().map(
      (part) => typeof part === 'string' ? element('span', {class: 'quiet'}, part) : part));
  }

  // Drawing.

  scaleOf(canvas) { return canvas.width / this.set.width * this.view.zoom; }

  imageName(k) {
    const name = this.images[k].name;
    return k === this.set.reference && name !== 'reference' ? `${name} (reference)` : name;
  }

  draw() {
    for (const pane of this.panes) this.drawPane(pane);
    this.drawTable();
  }

  drawPane(pane) {
    const canvas = pane.canvas, ratio = window.devicePixelRatio || 1;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height)
      canvas.width = width, canvas.height = height;
    const context = canvas.getContext('2d');
    context.clearRect(0, 0, width, height);
    const split = this.layout === 'split', left = this.layout === 'grid' ? pane.k : this.a;
    this.drawImage(context, left, 0, split ? Math.round(this.split * width) : width);
    if (split) this.drawSplit(context);
    this.drawCursor(context);
    const names = split ? [this.imageName(this.a), this.imageName(this.b)] : [this.imageName(left)];
    pane.name.replaceChildren(...names.map((name) => element('span', {}, name)));
    canvas.setAttribute('aria-label', names.join(' beside '));
  }

  drawImage(context, k, from, to) {
    const {width, height} = context.canvas, scale = this.scaleOf(context.canvas);
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, height);
    context.clip();
    context.imageSmoothingEnabled = scale < 1;
    context.translate(width / 2 - this.view.x * scale, height / 2 - this.view.y * scale);
    context.drawImage(this.picture(k), 0, 0, this.set.width * scale, this.set.height * scale);
    context.restore();
  }

  drawSplit(context) {
    const {width, height} = context.canvas, x = Math.round(this.split * width);
    this.drawImage(context, this.b, x, width);
    context.fillStyle = '#000';
    context.fillRect(x - 2, 0, 4, height);
    context.fillStyle = '#fff';
    context.fillRect(x - 1, 0, 2, height);
  }

  drawCursor(context) {
    if (!this.pixel) return;
    const {width, height} = context.canvas, scale = this.scaleOf(context.canvas);
    const x = width / 2 + (this.pixel.x - this.view.x) * scale;
    const y = height / 2 + (this.pixel.y - this.view.y) * scale;
    const size = Math.max(scale, 5), shift = (scale - size) / 2;
    for (const [color, line] of [['#000', 3], ['#fff', 1]]) {
      context.strokeStyle = color;
      context.lineWidth = line;
      context.strokeRect(x + shift, y + shift, size, size);
    }
  }

  drawTable() {
    const cell = (value) => element('td', {class: 'number'}, value);
    const head = element('tr', {}, ...['image', 'R', 'G', 'B', 'luminance', 'error',
                                       'relative'].map((text, i) => element(
                                         'th', {class: i ? 'number' : '', scope: 'col'}, text)));
    const rows = this.pixel ? this.images.map((image, k) => {
      const i = this.pixel.y * this.set.width + this.pixel.x;
      const value = luminanceOf(image.pixels, i);
      const wanted = luminanceOf(this.images[this.set.reference].pixels, i);
      return element('tr', {}, element('td', {}, this.imageName(k)),
                     ...[0, 1, 2].map((c) => cell(formatNumber(image.pixels[3 * i + c]))),
                     cell(formatNumber(value)), cell(formatNumber(value - wanted)),
                     cell(wanted > 0 ? formatNumber(100 * (value / wanted - 1)) + ' %' : '\u2013'));
    }) : [];
    const where = this.pixel ? `Pixel ${this.pixel.x}, ${this.pixel.y} from the top left`
                             : 'Move over an image';
    this.table.replaceChildren(element('caption', {}, where),
                               element('thead', {}, head), element('tbody', {}, ...rows));
  }

  // Pointer and keys.

  toImage(pane, event) {
    const box = pane.canvas.getBoundingClientRect();
    const scale = box.width / this.set.width * this.view.zoom;
    return {x: this.view.x + (event.clientX - box.left - box.width / 2) / scale,
            y: this.view.y + (event.clientY - box.top - box.height / 2) / scale};
  }

  zoomAt(point, factor) {
    const zoom = Math.min(64, Math.max(0.25, this.view.zoom * factor));
    const keep = this.view.zoom / zoom;
    this.view = {zoom, x: point.x + (this.view.x - point.x) * keep,
                 y: point.y + (this.view.y - point.y) * keep};
    this.draw();
  }

  press(pane, event) {
    pane.canvas.setPointerCapture(event.pointerId);
    const box = pane.canvas.getBoundingClientRect();
    const at = (event.clientX - box.left) / box.width;
    const onSplit = this.layout === 'split' && Math.abs(at - this.split) * box.width < 8;
    this.drag = {split: onSplit, from: this.toImage(pane, event)};
  }

  move(pane, event) {
    const at = this.toImage(pane, event);
    if (this.drag && this.drag.split) {
      const box = pane.canvas.getBoundingClientRect();
      this.split = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
      this.splitSlider.set(this.split);
    } else if (this.drag) {
      this.view.x += this.drag.from.x - at.x;
      this.view.y += this.drag.from.y - at.y;
    }
    const x = Math.floor(at.x), y = Math.floor(at.y);
    if (!this.drag && x >= 0 && y >= 0 && x < this.set.width && y < this.set.height)
      this.pixel = {x, y};
    this.draw();
  }

  moveCursor(dx, dy) {
    const p = this.pixel || {x: Math.floor(this.view.x), y: Math.floor(this.view.y)};
    this.pixel = {x: Math.min(this.set.width - 1, Math.max(0, p.x + dx)),
                  y: Math.min(this.set.height - 1, Math.max(0, p.y + dy))};
    this.draw();
  }

  key(event) {
    if (!(event.target instanceof HTMLCanvasElement) || event.ctrlKey || event.altKey ||
        event.metaKey) return;
    const centre = this.pixel ? {x: this.pixel.x + 0.5, y: this.pixel.y + 0.5} : this.view;
    const step = event.shiftKey ? 10 : 1;
    const actions = {
      'ArrowLeft': () => this.moveCursor(-step, 0), 'ArrowRight': () => this.moveCursor(step, 0),
      'ArrowUp': () => this.moveCursor(0, -step), 'ArrowDown': () => this.moveCursor(0, step),
      '+': () => this.zoomAt(centre, Math.SQRT2), '=': () => this.zoomAt(centre, Math.SQRT2),
      '-': () => this.zoomAt(centre, Math.SQRT1_2), ' ': () => this.swap(),
      '0': () => { this.resetView(); this.draw(); }};
    const digit = /^[1-9]$/.test(event.key) && Number(event.key) <= this.images.length;
    if (digit) {
      this.a = Number(event.key) - 1;
      this.aButtons.press(this.a);
      this.update();
    } else if (actions[event.key]) {
      actions[event.key]();
    } else {
      return;
    }
    event.preventDefault();
  }
}

function buildComparer() {
  if (report.image_sets.length === 0) return;
  const node = section('images', 'Images'), place = element('div'), made = new Map();
  const show = (i) => {
    if (!made.has(i)) {
      const comparer = new Comparer(report.image_sets[i], i);
      made.set(i, comparer);
      comparer.build();
    }
    place.replaceChildren(made.get(i).node);
    made.get(i).draw();
  };
  if (report.image_sets.length > 1)
    node.append(choiceButtons('set of images', report.image_sets.map((set, i) => [i, set.name]), 0,
                              show));
  node.append(place);
  show(0);
}
