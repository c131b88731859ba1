// Draws the sides of the page into one canvas: shadow map, then colour, normal and depth, then light.
import * as text from './shaders.js';
import { lightOf } from './camera.js';
import { paletteBytes, scaleBytes } from './colors.js';

const shadowSize = 1536;
const obstacleTint = [0.60, 0.535, 0.555];
const slots = 5;

export class Renderer {
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', { antialias: false, alpha: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('no webgl2');
    Object.assign(this, { canvas, gl });
    const make = (vertex, fragment) => this.program(text[vertex], text[fragment]);
    this.particles = make('particleVertex', 'particleFragment');
    this.particleShadow = make('particleShadowVertex', 'particleShadowFragment');
    this.meshes = make('meshVertex', 'meshFragment');
    this.meshShadow = make('meshShadowVertex', 'meshShadowFragment');
    this.floor = make('floorVertex', 'floorFragment');
    this.lines = make('lineVertex', 'lineFragment');
    this.light = make('screenVertex', 'lightFragment');
    this.colors = { speed: this.table(scaleBytes('speed')), error: this.table(scaleBytes('error')) };
    this.shadowDepth = this.texture(gl.DEPTH_COMPONENT24, shadowSize, shadowSize, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    this.shadowTarget = this.target([], this.shadowDepth);
    this.sides = [];
  }

  // ---- objects of WebGL -------------------------------------------------------------------------------------------
  program(vertex, fragment) {
    const gl = this.gl, id = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(id, shader);
    }
    gl.linkProgram(id);
    if (!gl.getProgramParameter(id, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(id));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(id, gl.ACTIVE_UNIFORMS); ++i) {
      const { name, type } = gl.getActiveUniform(id, i);
      uniforms[name] = { at: gl.getUniformLocation(id, name), type };
    }
    return { id, uniforms };
  }
  /** Values that the program does not have are left out. */
  use(program, values) {
    const gl = this.gl;
    gl.useProgram(program.id);
    for (const [name, value] of Object.entries(values)) {
      const uniform = program.uniforms[name];
      if (!uniform) continue;
      switch (uniform.type) {
        case gl.FLOAT: gl.uniform1f(uniform.at, value); break;
        case gl.FLOAT_VEC2: gl.uniform2fv(uniform.at, value); break;
        case gl.FLOAT_VEC3: gl.uniform3fv(uniform.at, value); break;
        case gl.FLOAT_VEC4: gl.uniform4fv(uniform.at, value); break;
        case gl.INT_VEC2: gl.uniform2iv(uniform.at, value); break;
        case gl.FLOAT_MAT3: gl.uniformMatrix3fv(uniform.at, false, value); break;
        case gl.FLOAT_MAT4: gl.uniformMatrix4fv(uniform.at, false, value); break;
        default: gl.uniform1i(uniform.at, value);
      }
    }
  }
  texture(format, width, height, filter) {
    const gl = this.gl, id = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, id);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return id;
  }
  table(bytes) {
    const gl = this.gl, id = this.texture(gl.RGBA8, 256, 1, gl.NEAREST);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 256, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return id;
  }
  target(colors, depth) {
    const gl = this.gl, id = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, id);
    colors.forEach((c, i) => gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, c, 0));
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    gl.drawBuffers(colors.length ? colors.map((_, i) => gl.COLOR_ATTACHMENT0 + i) : [gl.NONE]);
    return id;
  }
  buffer(data) {
    const gl = this.gl, id = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, id);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return id;
  }
  attribute(slot, buffer, size, type, stride = 0, offset = 0, normalized = false) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, size, type, normalized, stride, offset);
  }
  noAttributes() { for (let slot = 0; slot < slots; ++slot) this.gl.disableVertexAttribArray(slot); }
  bind(unit, id) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, id);
  }

  // ---- what is drawn ----------------------------------------------------------------------------------------------
  setRun(side, run) {
    this.sides[side] = {
      run, types: this.buffer(run.types), palette: this.table(paletteBytes(run.facts.materials)),
      corners: run.obstacles.corners.byteLength ? this.buffer(run.obstacles.corners) : null
    };
  }
  release(frame) {
    if (frame.buffer) this.gl.deleteBuffer(frame.buffer);
    frame.buffer = null;
  }
  setBox(camera) {
    const gl = this.gl, at = (c) => [0, 1, 2].map((d) => (c >> d & 1 ? camera.high[d] : camera.low[d])), edges = [];
    for (let a = 0; a < 8; ++a)
      for (const bit of [1, 2, 4]) if (!(a & bit)) edges.push(...at(a), ...at(a | bit));
    const axis = camera.up.findIndex((x) => Math.abs(x) > 0.5), ground = camera.up[axis] > 0 ? 0 : 1;
    const [u, v] = [1 << (axis + 1) % 3, 1 << (axis + 2) % 3], base = ground << axis;
    this.box = { edges: this.buffer(new Float32Array(edges)), count: edges.length / 3 };
    this.ground = this.buffer(new Float32Array([base, base | u, base | v, base | u | v].flatMap(at)));
    this.groundLevel = camera.up[axis] * (ground ? camera.high[axis] : camera.low[axis]);
    this.check = Math.max(...camera.high.map((x, d) => x - camera.low[d])) / 10;
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }
  resize(samples) {
    const gl = this.gl, scale = Math.min(2, window.devicePixelRatio || 1);
    const width = Math.max(2, Math.round(this.canvas.clientWidth * scale));
    const height = Math.max(2, Math.round(this.canvas.clientHeight * scale));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const key = `${width} ${height} ${samples}`;
    if (key === this.sizeKey) return;
    this.sizeKey = key;
    for (const id of this.targets || []) gl.deleteTexture(id);
    if (this.geometry) gl.deleteFramebuffer(this.geometry);
    const size = [samples * width, samples * height];
    this.targets = [gl.RGBA8, gl.RGBA8, gl.DEPTH_COMPONENT24].map((format) => this.texture(format, ...size, gl.NEAREST));
    this.geometry = this.target(this.targets.slice(0, 2), this.targets[2]);
  }

  /** panels: [{side, x, y, width, height (shares of the canvas), pair, other, uniforms}]; view: what all share. */
  draw(panels, view) {
    const samples = view.still && this.canvas.clientWidth * this.canvas.clientHeight < 3e6 ? 2 : 1;
    this.resize(samples);
    const { width, height } = this.canvas;
    for (const panel of panels) {
      const x = Math.round(panel.x * width), y = Math.round(panel.y * height);
      const w = Math.round((panel.x + panel.width) * width) - x, h = Math.round((panel.y + panel.height) * height) - y;
      const camera = view.camera.matrices(w / h), light = lightOf(view.camera);
      const shared = { ...camera, ...panel.uniforms, light: light.matrix, slice: view.slice, tint: obstacleTint };
      if (view.shadows) this.drawShadows(panel, view, shared, light);
      this.drawGeometry(panel, view, shared, [x, y, w, h].map((n) => samples * n), samples);
      this.drawLight(view, shared, light, [x, y, w, h], samples);
    }
  }
  bindParticles(panel, withOther) {
    const gl = this.gl, side = this.sides[panel.side];
    this.noAttributes();
    const positions = (slot, frame) => {
      if (!frame.buffer) frame.buffer = this.buffer(frame.positions);
      this.attribute(slot, frame.buffer, 3, gl.UNSIGNED_SHORT);
    };
    positions(0, panel.pair[0]);
    positions(1, panel.pair[1]);
    this.attribute(2, side.types, 1, gl.UNSIGNED_BYTE);
    if (!withOther || !panel.other) return;
    positions(3, panel.other[0]);
    positions(4, panel.other[1]);
  }
  drawParticles(panel, program, values, withOther) {
    const gl = this.gl, side = this.sides[panel.side];
    if (!panel.pair) return;
    this.use(program, values);
    this.bindParticles(panel, withOther);
    gl.drawArrays(gl.POINTS, 0, side.run.types.length);
  }
  drawObstacles(panel, program, values) {
    const gl = this.gl, side = this.sides[panel.side];
    if (!side.corners) return;
    this.noAttributes();
    this.attribute(0, side.corners, 3, gl.FLOAT, 16, 0);
    this.attribute(1, side.corners, 3, gl.BYTE, 16, 12, true);
    for (const { first, count, moving } of side.run.obstacles.parts) {
      const pose = moving < 0 || !panel.pair ? null : panel.pair[0].poses.subarray(12 * moving, 12 * moving + 12);
      const r = pose || [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];
      this.use(program, { ...values, rotation: [0, 3, 6, 1, 4, 7, 2, 5, 8].map((i) => r[i]), translation: [...r.slice(9)] });
      gl.drawArrays(gl.TRIANGLES, first, count);
    }
  }
  drawShadows(panel, view, shared, light) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.viewport(0, 0, shadowSize, shadowSize);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const pixels = Math.max(1, panel.uniforms.radius / light.radius * shadowSize);
    this.drawParticles(panel, this.particleShadow, { ...shared, pixels }, false);
    if (view.obstacles) this.drawObstacles(panel, this.meshShadow, shared);
  }
  drawGeometry(panel, view, shared, [x, y, w, h]) {
    const gl = this.gl, side = this.sides[panel.side];
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.geometry);
    gl.viewport(x, y, w, h);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, w, h);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (view.domain) this.drawDomain(view, shared);
    if (view.obstacles) this.drawObstacles(panel, this.meshes, shared);
    this.bind(0, side.palette);
    this.bind(1, panel.uniforms.coloring === 2 ? this.colors.error : this.colors.speed);
    const values = { ...shared, palette: 0, colors: 1, pixels: shared.focal * h };
    this.drawParticles(panel, this.particles, values, true);
  }
  drawDomain(view, shared) {
    const gl = this.gl, { camera } = view, above = camera.up.reduce((s, x, d) => s + x * shared.eye[d], 0);
    this.noAttributes();
    if (!camera.flat && above > this.groundLevel) {
      this.attribute(0, this.ground, 3, gl.FLOAT);
      this.use(this.floor, { ...shared, low: camera.low, up: camera.up, check: this.check });
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    this.attribute(0, this.box.edges, 3, gl.FLOAT);
    this.use(this.lines, shared);
    gl.drawArrays(gl.LINES, 0, this.box.count);
  }
  drawLight(view, shared, light, [x, y, w, h], samples) {
    const gl = this.gl, slope = 1 / shared.focal;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(x, y, w, h);
    gl.scissor(x, y, w, h);
    gl.disable(gl.DEPTH_TEST);
    this.noAttributes();
    this.targets.forEach((id, unit) => this.bind(unit, id));
    this.bind(3, this.shadowDepth);
    const [side, top, back] = shared.axes;
    this.use(this.light, {
      ...shared, side, top, back, towards: light.towards, colorOf: 0, normalOf: 1, depthOf: 2, shadowOf: 3, samples,
      origin: [samples * x, samples * y], size: [samples * w, samples * h], shadows: view.shadows,
      slope: [slope * shared.aspect, slope], bias: 1.2 * shared.radius + 3 * light.radius / shadowSize,
      softness: 1.2 / shadowSize
    });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
