// A camera that orbits the box of the run. Matrices are in the order of WebGL: by columns.
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const add = (a, b, s) => a.map((x, i) => x + s * b[i]);
const unit = (a) => { const n = Math.hypot(...a); return a.map((x) => x / n); };
const halfAngle = 0.3;  // of the picture's height [rad]

export class Camera {
  constructor(low, high, up, flat) {
    Object.assign(this, { low, high, up, flat });
    this.front = Math.abs(up[2]) > 0.5 ? [0, -1, 0] : [0, 0, 1];
    this.right = cross(up, this.front);
    this.reset();
  }
  reset() {
    this.yaw = this.flat ? 0 : 0.5;
    this.pitch = this.flat ? 0 : 0.32;
    this.zoom = 1;
    this.shift = [0, 0, 0];
  }
  axes() {
    const flatBack = add(this.front.map((x) => x * Math.cos(this.yaw)), this.right, Math.sin(this.yaw));
    const back = unit(add(flatBack.map((x) => x * Math.cos(this.pitch)), this.up, Math.sin(this.pitch)));
    const side = unit(cross(this.up, back));
    return { side, top: cross(back, side), back };
  }
  center() { return this.low.map((x, i) => (x + this.high[i]) / 2 + this.shift[i]); }
  reach() { return Math.hypot(...this.high.map((x, i) => x - this.low[i])); }
  corners() {
    const list = [];
    for (let c = 0; c < 8; ++c) list.push([0, 1, 2].map((d) => (c >> d & 1 ? this.high[d] : this.low[d])));
    return list;
  }
  /** From where the whole box is in the picture. */
  distance(aspect) {
    const { side, top, back } = this.axes(), middle = this.low.map((x, i) => (x + this.high[i]) / 2);
    const slope = Math.tan(halfAngle);
    let distance = 0;
    for (const corner of this.corners()) {
      const d = add(corner, middle, -1);
      distance = Math.max(distance, dot(d, back) + Math.abs(dot(d, top)) / slope,
                          dot(d, back) + Math.abs(dot(d, side)) / (slope * aspect));
    }
    return 1.06 * distance;
  }
  matrices(aspect) {
    const { side, top, back } = this.axes(), center = this.center();
    const distance = this.zoom * this.distance(aspect), eye = add(center, back, distance);
    const view = [side[0], top[0], back[0], 0, side[1], top[1], back[1], 0, side[2], top[2], back[2], 0,
                  -dot(side, eye), -dot(top, eye), -dot(back, eye), 1];
    const f = 1 / Math.tan(halfAngle), reach = this.reach();
    const far = distance + 3 * reach, near = Math.max(0.002 * reach, distance - 3 * reach);
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
                        0, 0, 2 * far * near / (near - far), 0];
    return { view, projection, eye, focal: f, axes: [side, top, back], aspect, near, far };
  }
  orbit(x, y) {
    if (this.flat) return;
    this.yaw -= 0.008 * x;
    this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch + 0.008 * y));
  }
  /** By pixels of a picture of this height. */
  pan(x, y, height, aspect) {
    const { side, top } = this.axes();
    const scale = 2 * Math.tan(halfAngle) * this.zoom * this.distance(aspect) / height;
    this.shift = add(add(this.shift, side, -x * scale), top, y * scale);
  }
  scale(factor) { this.zoom = Math.max(0.02, Math.min(6, this.zoom * factor)); }
}

/** From the light, parallel rays, around the whole box: towards the light, view-projection, depth of the box [m]. */
export function lightOf(camera) {
  const towards = unit(add(add(camera.up, camera.front, 0.45), camera.right, 0.35));
  const side = unit(cross(Math.abs(towards[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0], towards)), top = cross(towards, side);
  const middle = camera.low.map((x, i) => (x + camera.high[i]) / 2), r = 0.55 * camera.reach();
  const row = (axis, s) => [...axis.map((x) => x * s), -dot(axis, middle) * s];
  const rows = [row(side, 1 / r), row(top, 1 / r), row(towards, -1 / r), [0, 0, 0, 1]];
  return { towards, matrix: [0, 1, 2, 3].flatMap((c) => rows.map((x) => x[c])), depth: 2 * r, radius: r };
}
