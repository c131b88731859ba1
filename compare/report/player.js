// Particle player of the report: truth on the left, a model on the right, one orbiting camera for both.
'use strict';
(() => {
const root = document.documentElement;
window.addEventListener('error', (e) => { root.dataset.error = e.message; });
const byId = (id) => document.getElementById(id);
const index = JSON.parse(byId('player-index').textContent);
const canvas = byId('player-canvas'), scenePick = byId('player-scene'), modelPick = byId('player-model');
const playButton = byId('player-play'), scrub = byId('player-scrub'), note = byId('player-note');
const gl = canvas.getContext('webgl2', { antialias: true });
if (!gl) {
  byId('player-message').textContent = 'This browser has no WebGL2: the particle player cannot draw.';
  root.dataset.player = 'no webgl2';
  return;
}

const palette = {
  4: [92, 190, 104], 5: [56, 132, 224], 6: [218, 168, 84], 7: [236, 130, 150], 8: [240, 244, 250], 9: [60, 160, 150],
  10: [150, 156, 168], 11: [140, 92, 60], 12: [236, 214, 120], 13: [110, 104, 100]
};
const other = [190, 120, 200];

// ---- programs -------------------------------------------------------------------------------------------------
// Points are spheres: the vertex shader sizes the sprite, the fragment shader shades it and pushes its depth forward.
const pointVertex = `#version 300 es
layout(location=0) in vec3 now; layout(location=1) in vec3 next;
layout(location=2) in vec3 color; layout(location=3) in vec3 normal;
uniform mat4 view, projection; uniform vec3 low, size; uniform float blend, radius, pixels;
out vec3 tint; out vec3 side; out float nearness;
void main() {
  // 1 on all axes: not in the run. A step of over half the box is one through a periodic wall.
  bool absent = all(equal(now, vec3(1.0))) || (blend > 0.0 && all(equal(next, vec3(1.0))));
  vec3 at = any(greaterThan(abs(next - now), vec3(0.5))) ? now : mix(now, next, blend);
  vec4 p = view * vec4(low + size * at, 1.0);
  gl_Position = absent ? vec4(2.0, 2.0, 2.0, 1.0) : projection * p;
  gl_PointSize = max(1.5, pixels * radius / -p.z);
  tint = color; side = mat3(view) * normal;
  nearness = clamp(1.25 + 0.22 * p.z / length(size), 0.55, 1.15);
}`;
const pointFragment = `#version 300 es
precision highp float;
in vec3 tint; in vec3 side; in float nearness; out vec4 shown;
void main() {
  vec2 q = 2.0 * gl_PointCoord - 1.0; q.y = -q.y;
  float r2 = dot(q, q);
  if (r2 > 1.0) discard;
  vec3 n = length(side) > 0.5 ? normalize(side) : vec3(q, sqrt(1.0 - r2));
  float light = 0.45 + 0.6 * max(0.0, dot(n, normalize(vec3(-0.35, 0.8, 0.5))));
  shown = vec4(tint * light * nearness, 1.0);
}`;
const lineVertex = `#version 300 es
layout(location=0) in vec3 corner; uniform mat4 view, projection; uniform vec3 low, size;
void main() { gl_Position = projection * view * vec4(low + size * corner, 1.0); }`;
const lineFragment = `#version 300 es
precision mediump float; out vec4 shown; void main() { shown = vec4(0.62, 0.65, 0.70, 1.0); }`;

function program(vertex, fragment) {
  const p = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(p, shader);
  }
  gl.linkProgram(p);
  if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(p));
  const place = {};
  for (const name of ['view', 'projection', 'low', 'size', 'blend', 'radius', 'pixels'])
    place[name] = gl.getUniformLocation(p, name);
  return { p, place };
}
const points = program(pointVertex, pointFragment), lines = program(lineVertex, lineFragment);

// ---- data -----------------------------------------------------------------------------------------------------
function bytes(id) {
  const text = atob(byId(id).textContent);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) out[i] = text.charCodeAt(i);
  return out;
}
function buffer(data) {
  const b = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, b);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  return b;
}
const loaded = new Map();
function load(track) {
  if (!loaded.has(track.id)) {
    const types = bytes(track.id + 't'), colors = new Uint8Array(3 * track.particles);
    types.forEach((type, i) => colors.set(palette[type] || other, 3 * i));
    loaded.set(track.id, { position: buffer(bytes(track.id + 'p')), color: buffer(colors) });
  }
  return loaded.get(track.id);
}
function loadObstacles(scene) {
  const id = scene.obstacles.id;
  if (!loaded.has(id)) loaded.set(id, { position: buffer(bytes(id + 'p')), normal: buffer(new Int8Array(bytes(id + 'n').buffer)) });
  return loaded.get(id);
}
const boxCorners = [];
for (let axis = 0; axis < 3; ++axis)
  for (const a of [0, 1]) for (const b of [0, 1]) for (const c of [0, 1]) {
    const corner = [0, 0, 0];
    corner[axis] = c; corner[(axis + 1) % 3] = a; corner[(axis + 2) % 3] = b;
    boxCorners.push(...corner);
  }
const box = buffer(new Float32Array(boxCorners));

// ---- camera ---------------------------------------------------------------------------------------------------
let yaw = 0.5, pitch = 0.42, zoom = 1;
const add = (a, b, s) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));
function camera(scene, aspect) {
  const up = scene.up, front = Math.abs(up[2]) > 0.5 ? [0, -1, 0] : [0, 0, 1], right = cross(up, front);
  const flat = add(front.map((x) => x * Math.cos(yaw)), right, Math.sin(yaw));
  const back = unit(add(flat.map((x) => x * Math.cos(pitch)), up, Math.sin(pitch)));
  const side = unit(cross(up, back)), top = cross(back, side);
  const center = add(scene.low, scene.size, 0.5), reach = Math.hypot(...scene.size);
  const distance = zoom * reach * 1.55 * Math.max(1, 1 / aspect), eye = add(center, back, distance);
  const view = [side[0], top[0], back[0], 0, side[1], top[1], back[1], 0, side[2], top[2], back[2], 0,
                -dot(side, eye), -dot(top, eye), -dot(back, eye), 1];
  const f = 1 / Math.tan(0.33), near = 0.02 * reach, far = distance + 2 * reach;
  const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
                      0, 0, 2 * far * near / (near - far), 0];
  return { view, projection, focal: f };
}

// ---- drawing --------------------------------------------------------------------------------------------------
function setUniforms(target, scene, cam) {
  gl.useProgram(target.p);
  gl.uniformMatrix4fv(target.place.view, false, cam.view);
  gl.uniformMatrix4fv(target.place.projection, false, cam.projection);
  gl.uniform3fv(target.place.low, scene.low);
  gl.uniform3fv(target.place.size, scene.size);
}
function attribute(slot, b, type, stride, offset, normalized = true) {
  gl.bindBuffer(gl.ARRAY_BUFFER, b);
  gl.enableVertexAttribArray(slot);
  gl.vertexAttribPointer(slot, 3, type, normalized, stride, offset);
}
function drawTrack(track, at) {
  const data = load(track), last = track.frames.length - 1;
  let k = 0;
  while (k < last && track.frames[k + 1] <= at) ++k;
  const next = Math.min(k + 1, last), gap = track.frames[next] - track.frames[k];
  const row = 6 * track.particles;
  attribute(0, data.position, gl.UNSIGNED_SHORT, 6, row * k);
  attribute(1, data.position, gl.UNSIGNED_SHORT, 6, row * next);
  attribute(2, data.color, gl.UNSIGNED_BYTE, 3, 0);
  gl.disableVertexAttribArray(3);
  gl.vertexAttrib3f(3, 0, 0, 0);
  gl.uniform1f(points.place.blend, gap > 0 ? Math.min(1, (at - track.frames[k]) / gap) : 0);
  gl.uniform1f(points.place.radius, track.radius);
  gl.drawArrays(gl.POINTS, 0, track.particles);
}
function drawObstacles(scene) {
  if (!scene.obstacles.points) return;
  const data = loadObstacles(scene);
  attribute(0, data.position, gl.UNSIGNED_SHORT, 6, 0);
  attribute(1, data.position, gl.UNSIGNED_SHORT, 6, 0);
  gl.disableVertexAttribArray(2);
  gl.vertexAttrib3f(2, 0.56, 0.50, 0.52);
  attribute(3, data.normal, gl.BYTE, 3, 0);
  gl.uniform1f(points.place.blend, 0);
  gl.uniform1f(points.place.radius, scene.obstacles.radius);
  gl.drawArrays(gl.POINTS, 0, scene.obstacles.points);
}
function drawSide(scene, track, at, x, width, height) {
  gl.viewport(x, 0, width, height);
  const cam = camera(scene, width / height);
  setUniforms(lines, scene, cam);
  for (const slot of [1, 2, 3]) gl.disableVertexAttribArray(slot);
  attribute(0, box, gl.FLOAT, 12, 0, false);
  gl.drawArrays(gl.LINES, 0, boxCorners.length / 3);
  setUniforms(points, scene, cam);
  gl.uniform1f(points.place.pixels, cam.focal * height);
  drawObstacles(scene);
  drawTrack(track, at);
}

let frame = 0, playing = false, lastTime = 0;
const scene = () => index.scenes[scenePick.selectedIndex];
const model = () => scene().tracks[modelPick.selectedIndex + 1];
function draw() {
  const scale = Math.min(2, window.devicePixelRatio || 1);
  canvas.width = Math.max(2, Math.round(canvas.clientWidth * scale));
  canvas.height = Math.max(2, Math.round(canvas.clientHeight * scale));
  gl.clearColor(0.17, 0.18, 0.205, 1);
  gl.enable(gl.DEPTH_TEST);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const half = Math.floor(canvas.width / 2);
  drawSide(scene(), scene().tracks[0], frame, 0, half, canvas.height);
  if (model()) drawSide(scene(), model(), frame, half, canvas.width - half, canvas.height);
  byId('player-time').textContent = `frame ${Math.round(frame)}, ${(frame * scene().frameTime).toFixed(2)} s`;
  scrub.value = frame;
}
function countDrawn() {
  const pixel = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  let left = 0, right = 0;
  for (let i = 0; i < pixel.length; i += 4)
    if (Math.abs(pixel[i] - 43) + Math.abs(pixel[i + 1] - 46) + Math.abs(pixel[i + 2] - 52) > 12)
      (i / 4) % canvas.width < canvas.width / 2 ? ++left : ++right;
  return `drawn ${left} ${right}`;
}
function tick(time) {
  if (playing) {
    frame += Math.min(0.1, (time - lastTime) / 1000) / scene().frameTime;
    if (frame > scene().frames) frame = 0;
    draw();
    requestAnimationFrame(tick);
  }
  lastTime = time;
}
function play(on) {
  playing = on;
  playButton.textContent = on ? 'Pause' : 'Play';
  lastTime = performance.now();
  if (on) requestAnimationFrame(tick);
}
function describe() {
  const s = scene(), t = s.tracks[0], m = model();
  const thin = (track) => `${track.particles} of ${track.allParticles} particles, ${track.frames.length} of ${s.frames + 1} frames`;
  note.textContent = `Shown (thinned, 16-bit positions): truth ${thin(t)}` + (m ? `; ${m.label} ${thin(m)}` : '') + '.';
  byId('player-right').textContent = m ? m.label : '';
}
function pickScene() {
  modelPick.replaceChildren(...scene().tracks.slice(1).map((t) => new Option(t.label)));
  const learned = scene().tracks.slice(1).findIndex((t) => !t.label.startsWith('mpm'));
  const cheaper = scene().tracks.slice(1).findIndex((t) => t.label !== 'mpm');
  modelPick.selectedIndex = Math.max(0, learned >= 0 ? learned : cheaper);
  scrub.max = scene().frames;
  frame = Math.min(frame, scene().frames);
  describe();
  draw();
}

// ---- controls -------------------------------------------------------------------------------------------------
scenePick.replaceChildren(...index.scenes.map((s) => new Option(s.name)));
scenePick.addEventListener('change', pickScene);
modelPick.addEventListener('change', () => { describe(); draw(); });
playButton.addEventListener('click', () => play(!playing));
scrub.addEventListener('input', () => { play(false); frame = Number(scrub.value); draw(); });
canvas.addEventListener('pointerdown', (e) => canvas.setPointerCapture(e.pointerId));
canvas.addEventListener('pointermove', (e) => {
  if (!e.buttons) return;
  yaw -= 0.008 * e.movementX;
  pitch = Math.max(-1.5, Math.min(1.5, pitch + 0.008 * e.movementY));
  draw();
});
canvas.addEventListener('wheel', (e) => {
  e.preventDefault();
  zoom = Math.max(0.15, Math.min(4, zoom * Math.exp(0.001 * e.deltaY)));
  draw();
}, { passive: false });
window.addEventListener('resize', draw);

frame = Math.round(index.scenes[0].frames / 3);
pickScene();
root.dataset.player = countDrawn();
})();
