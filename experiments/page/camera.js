// SPDX-License-Identifier: GPL-3.0-or-later
// What the 3D view draws with: shaders, vectors, the ball of a probe, a camera that orbits.

const sceneVertexShader = `
attribute vec3 position; attribute vec3 normal; attribute vec3 color;
uniform mat4 matrix; varying vec3 shade; varying float height;
void main() {
  height = position.y;
  float light = 0.62 + 0.26 * dot(normal, vec3(0.36, 0.80, 0.48)) + 0.10 * normal.x;
  shade = color * light;
  gl_Position = matrix * vec4(position, 1.0);
}`;
const probeVertexShader = `
attribute vec3 position; attribute vec3 normal; attribute vec3 color;
uniform mat4 matrix; uniform float radius; uniform vec3 eye;
varying vec3 shade; varying float height;
void main() {
  height = position.y;
  vec3 place = position + radius * normal;
  float facing = max(dot(normal, normalize(eye - place)), 0.0);
  shade = color * (0.45 + 0.55 * facing);
  gl_Position = matrix * vec4(place, 1.0);
}`;
const fragmentShader = `
precision highp float; varying vec3 shade; varying float height; uniform float cut;
void main() {
  if (height > cut) discard;
  gl_FragColor = vec4(shade, 1.0);
}`;

const vec = {
  add: (a, b) => a.map((x, i) => x + b[i]),
  sub: (a, b) => a.map((x, i) => x - b[i]),
  scale: (a, s) => a.map((x) => x * s),
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                    a[0] * b[1] - a[1] * b[0]],
  unit: (a) => vec.scale(a, 1 / (Math.hypot(...a) || 1))};

// Triangles of a ball, as unit vectors: an octahedron, each face split in four `rounds` times.
function ballTriangles(rounds) {
  const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], n = (v) => vec.scale(v, -1);
  let faces = [[x, y, z], [z, y, n(x)], [n(x), y, n(z)], [n(z), y, x],
               [z, n(y), x], [n(x), n(y), z], [n(z), n(y), n(x)], [x, n(y), n(z)]];
  for (let round = 0; round < rounds; ++round) {
    faces = faces.flatMap(([a, b, c]) => {
      const [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(([p, q]) => vec.unit(vec.add(p, q)));
      return [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
    });
  }
  return faces.flat();
}

const cameraFocal = 1 / Math.tan(Math.PI / 8);  // 45 degrees from top to bottom
const steepest = Math.PI / 2 - 0.001;

// Looks at a target; angles in radians, distances in metres.
class OrbitCamera {
  constructor(box) {
    this.box = box;
    this.diagonal = Math.hypot(...vec.sub(box.max, box.min)) || 1;
    this.reset();
  }

  reset() {
    this.target = vec.scale(vec.add(this.box.min, this.box.max), 0.5);
    Object.assign(this, {yaw: 0.35 + this.longSide(), pitch: 0.9, distance: this.diagonal,
                         fits: false});
  }

  // The yaw from which the longer side of the box lies across the view.
  longSide() {
    const size = vec.sub(this.box.max, this.box.min);
    return size[2] > size[0] ? Math.PI / 2 : 0;
  }

  lookDown() {
    this.reset();
    Object.assign(this, {yaw: this.longSide(), pitch: steepest});
  }

  basis() {
    const {yaw, pitch} = this;
    const back = [Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch),
                  Math.cos(pitch) * Math.cos(yaw)];
    const right = [Math.cos(yaw), 0, -Math.sin(yaw)];
    return {back, right, up: vec.cross(back, right)};
  }

  // The least distance from which all of the box is seen.
  fit(aspect) {
    const {back, right, up} = this.basis(), {min, max} = this.box;
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const place = [0, 1, 2].map((c) => (corner >> c & 1 ? max[c] : min[c]) - this.target[c]);
      const reach = cameraFocal * Math.max(Math.abs(vec.dot(place, right)) / aspect,
                                           Math.abs(vec.dot(place, up)));
      distance = Math.max(distance, reach + vec.dot(place, back));
    }
    this.distance = 1.04 * distance || 1;
    this.fits = true;
  }

  // The matrix by rows and, for WebGL, by columns; and where the eye is.
  projection(aspect) {
    if (!this.fits) this.fit(aspect);
    const {back, right, up} = this.basis();
    const eye = vec.add(this.target, vec.scale(back, this.distance));
    const far = this.distance + 2 * this.diagonal;
    const near = Math.max(this.distance / 200, far / 20000);
    const rows = [[...vec.scale(right, cameraFocal / aspect),
                   -cameraFocal / aspect * vec.dot(right, eye)],
                  [...vec.scale(up, cameraFocal), -cameraFocal * vec.dot(up, eye)]];
    const depth = [...back, -vec.dot(back, eye)], a = (far + near) / (near - far);
    rows.push(depth.map((x, i) => a * x + (i === 3 ? 2 * far * near / (near - far) : 0)));
    rows.push(depth.map((x) => -x));
    const columns = new Float32Array(16);
    for (let row = 0; row < 4; ++row)
      for (let column = 0; column < 4; ++column) columns[4 * column + row] = rows[row][column];
    return {columns, rows, eye};
  }

  zoom(factor) {
    this.distance = Math.min(8 * this.diagonal,
                             Math.max(this.diagonal / 500, this.distance * factor));
  }

  orbit(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(steepest, Math.max(-steepest, this.pitch + pitch));
  }

  // By shares of the view's height.
  pan(x, y) {
    const {right, up} = this.basis(), size = 2 * this.distance / cameraFocal;
    const shift = vec.add(vec.scale(right, -x * size), vec.scale(up, y * size));
    this.target = vec.add(this.target, shift);
  }
}
