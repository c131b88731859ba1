// The page: what is shown when, and what buttons, keys and the pointer do.
import { facts as getFacts, status as getStatus, command, Run, absent } from './data.js';
import { Camera } from './camera.js';
import { Renderer } from './drawing.js';
import { gradient, roundUp, short } from './colors.js';
import { connectPointer } from './pointer.js';

const root = document.documentElement, byId = (id) => document.getElementById(id);
const canvas = byId('canvas');
const state = { time: 0, playing: false, rate: 1, coloring: 'material', slice: 'off', refused: '', scale: { speed: 0, error: 0 }, still: true };
const framesAhead = 12;
let runs = [], renderer, camera, drawQueued = false, lastTick = 0, stillTimer = 0, drawMilliseconds = 0, pictureCount = 0;

function say(text) {
  byId('message').hidden = !text;
  byId('message').textContent = text;
}
function fail(error) {
  root.dataset.view = 'failed';
  say(error.message || String(error));
}
window.addEventListener('error', (e) => fail(e.error || e));
window.addEventListener('unhandledrejection', (e) => fail(e.reason));

// ---- time ---------------------------------------------------------------------------------------------------------
/** Times of two runs that are one. */
const sameTime = 1e-6;
const endOf = (run) => run.facts.times[Math.max(0, run.ready - 1)];
/** The side that ends last, or has most frames, sets the steps of time. */
const leader = () => runs.reduce((a, b) => {
  const later = b.facts.times.at(-1) - a.facts.times.at(-1);
  return later > sameTime || (later > -sameTime && b.facts.times.length > a.facts.times.length) ? b : a;
});
/** Of runs that go on, what is there. */
const lastTime = () => Math.min(Math.max(...runs.map(endOf)), ...runs.filter((run) => run.facts.live && goesOn(run)).map(endOf));
/** Whether a run has a frame at the time shown, or one before and one after it. */
const covers = (run) => state.time <= endOf(run) + sameTime;
function setTime(time) {
  state.time = Math.max(0, Math.min(lastTime(), time));
  for (const run of runs) {
    const { k, next } = run.place(state.time), wanted = [k, next];
    if (k === next && k > 0) wanted.push(k - 1);  // for the speed
    for (let ahead = 1; state.playing && ahead <= framesAhead && next + ahead < run.ready; ++ahead) wanted.push(next + ahead);
    run.want(wanted);
    run.trim(runs.length, (frame) => renderer.release(frame));
  }
  redraw();
}
function stepFrames(count) {
  const run = leader(), { k, blend } = run.place(state.time);
  const to = Math.max(0, Math.min(run.ready - 1, k + count + (count < 0 && blend > 0 ? 1 : 0)));
  play(false);
  setTime(run.facts.times[to]);
}
/** Both frames around a time, where they are there. */
function pairAt(run, time) {
  const { k, next, blend } = run.place(time);
  // At the last frame the one before it, so that there is a speed.
  const first = k === next && k > 0 ? k - 1 : k, pair = [run.frames.get(first), run.frames.get(next)];
  if (first !== k && !pair[0]) return run.frames.get(k) && { pair: [run.frames.get(k), run.frames.get(k)], blend: 0, gap: 1 };
  if (!pair[0] || !pair[1]) return null;
  return { pair, blend: first === k ? blend : 1, gap: run.facts.times[next] - run.facts.times[first] || 1 };
}
function play(on) {
  if (on && state.time >= lastTime() && !runs.some((run) => run.state === 'running')) state.time = 0;
  state.playing = on;
  byId('play').textContent = on ? '❚❚' : '▶';
  byId('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  lastTick = performance.now();
  setTime(state.time);
  if (on) requestAnimationFrame(tick);
}
/** Time waits for frames that are not there yet. */
function tick(now) {
  if (!state.playing) return;
  const next = Math.min(lastTime(), state.time + Math.min(0.1, (now - lastTick) / 1000) * state.rate);
  lastTick = now;
  if (next > state.time && runs.every((run) => pairAt(run, next))) {
    state.time = next;
    ++pictureCount;
  } else if (next <= state.time && !runs.some((run) => run.facts.live && run.state !== 'done' && run.state !== 'failed')) {
    state.time = 0;
  }
  setTime(state.time);
  requestAnimationFrame(tick);
}

// ---- picture ------------------------------------------------------------------------------------------------------
function redraw() {
  moving();
  if (drawQueued) return;
  drawQueued = true;
  requestAnimationFrame(() => { drawQueued = false; draw(); });
}
/** Pictures that stay for a moment are drawn once more, with more samples. */
function moving() {
  if (stillTimer) clearTimeout(stillTimer);
  state.still = false;
  stillTimer = setTimeout(() => { state.still = true; stillTimer = 0; draw(); }, 120);
}
function layout() {
  if (runs.length < 2) return [[0, 0, 1, 1]];
  return canvas.clientWidth > canvas.clientHeight * 0.9 ? [[0, 0, 0.5, 1], [0.5, 0, 0.5, 1]] : [[0, 0.5, 1, 0.5], [0, 0, 1, 0.5]];
}
const errorPossible = () => runs.length === 2 && runs[0].types.length === runs[1].types.length;
const errorShown = () => errorPossible() && runs.every(covers);
function slicePlane() {
  if (state.slice === 'off') {
    const plane = camera.flat ? runs[0].facts.plane : null;
    return plane === null ? [0, 0, 0, 1e30] : [0, 0, 1, plane + 1e-6 * camera.reach()];
  }
  const axis = 'xyz'.indexOf(state.slice), share = Number(byId('slice-at').value);
  const at = camera.low[axis] + share * (camera.high[axis] - camera.low[axis]);
  byId('slice-text').textContent = `${short(at)} m`;
  // What is nearer to the eye than the plane is taken away.
  const sign = camera.axes().back[axis] >= 0 ? 1 : -1;
  return [0, 1, 2].map((d) => (d === axis ? sign : 0)).concat(sign * at);
}
function panelOf(side, places) {
  const run = runs[side], own = places[side], rival = places[1 - side];
  const coloring = ['material', 'speed', 'error'].indexOf(state.coloring), zero = [0, 0, 0];
  const withOther = coloring === 2 && own && rival && errorShown(), other = withOther ? rival.pair : null;
  const [x, y, width, height] = layout()[side];
  return {
    side, x, y, width, height, pair: own && own.pair, other,
    uniforms: {
      coloring: coloring === 2 && !withOther ? 0 : coloring, period: run.facts.period,
      radius: run.facts.radius * Number(byId('size').value), scale: state.scale[state.coloring] || 1,
      perSecond: own ? 1 / own.gap : 0, blend: own ? own.blend : 0,
      nowLow: own ? own.pair[0].low : zero, nowStep: own ? own.pair[0].step : zero,
      nextLow: own ? own.pair[1].low : zero, nextStep: own ? own.pair[1].step : zero,
      otherBlend: other ? rival.blend : 0, otherLow: other ? other[0].low : zero, otherStep: other ? other[0].step : zero,
      otherNextLow: other ? other[1].low : zero, otherNextStep: other ? other[1].step : zero
    }
  };
}
function draw() {
  const start = performance.now(), places = runs.map((run) => pairAt(run, state.time));
  if (!places.some(Boolean)) return;
  if (state.coloring !== 'material' && !(state.scale[state.coloring] > 0)) fitScale();
  renderer.draw(runs.map((_, side) => panelOf(side, places)), {
    camera, slice: slicePlane(), still: state.still, shadows: byId('shadows').checked && !camera.flat,
    obstacles: byId('obstacles').checked, domain: byId('domain').checked
  });
  describe(places);
  drawMilliseconds = performance.now() - start;
  if (state.still && places.every(Boolean)) root.dataset.view = 'shown';
}

// ---- numbers ------------------------------------------------------------------------------------------------------
/** Values of the colouring of some particles: speeds [m/s] or errors [m]. */
function sampledValues() {
  const places = runs.map((run) => pairAt(run, state.time)), values = [];
  if (state.coloring === 'error' && !errorShown()) return values;
  const x = (place, which, i, d) => place.pair[which].low[d] + place.pair[which].step[d] * place.pair[which].positions[3 * i + d];
  const at = (place, i, d) => x(place, 0, i, d) + place.blend * (x(place, 1, i, d) - x(place, 0, i, d));
  const missing = (place, i) => place.pair.some((frame) => frame.positions[3 * i] === absent);
  const near = (d, period) => (period > 0 ? d - period * Math.round(d / period) : d);
  for (const [side, run] of runs.entries()) {
    const own = places[side], rival = places[1 - side], period = run.facts.period;
    if (!own || (state.coloring === 'error' && (!rival || side > 0))) continue;
    const stride = Math.ceil(run.types.length / 20000);
    for (let i = 0; i < run.types.length; i += stride) {
      if (missing(own, i) || (state.coloring === 'error' && missing(rival, i))) continue;
      const way = [0, 1, 2].map((d) => near(state.coloring === 'speed' ? x(own, 1, i, d) - x(own, 0, i, d) : at(own, i, d) - at(rival, i, d), period[d]));
      values.push(Math.hypot(...way) / (state.coloring === 'speed' ? own.gap : 1));
    }
  }
  return values;
}
function fitScale() {
  const values = sampledValues().sort((a, b) => a - b);
  if (!values.length) return;
  state.scale[state.coloring] = roundUp(Math.max(1e-6, values[Math.floor(0.98 * (values.length - 1))]));
  byId('scale').value = state.scale[state.coloring];
}
function describe(places) {
  const run = leader(), { k } = run.place(state.time), last = Math.max(0, run.facts.times.length - 1);
  byId('time').innerHTML = `frame ${k}<span class="more"> of ${last}</span>, ${state.time.toFixed(2)} s`;
  byId('scrub').max = last;
  byId('scrub').value = k;
  const box = layout();
  runs.forEach((one, side) => {
    const [x, y, width, height] = box[side], label = byId(`label-${side}`), own = places[side];
    Object.assign(label.style, { left: `${100 * x}%`, top: `${100 * (1 - y - height)}%`, maxWidth: `${100 * width}%` });
    const lines = [`${one.types.length.toLocaleString('en')} particles` + (one.facts.made_by ? `, by ${one.facts.made_by.replace(/.*\//, '')}` : '')];
    const warnings = [one.facts.note, one.problem, one.state === 'failed' ? one.said : '', covers(one) ? '' : `ends at ${endOf(one).toFixed(2)} s`,
      own && own.pair[0].leftOut ? `${own.pair[0].leftOut} particles are far outside and not drawn` : ''];
    label.replaceChildren(one.facts.name, ...lines.map((t) => small(t)), ...warnings.filter(Boolean).map((t) => small(t, 'warn')));
  });
  describeLegend(places);
  const megabytes = run.facts.record_bytes / 1e6, step = Math.max(...(places.find(Boolean).pair[0].step)) / 2;
  byId('figures').textContent = (state.playing ? `${state.pictures || 0} pictures/s, ${drawMilliseconds.toFixed(1)} ms to draw. ` : '') +
    `A frame: ${megabytes < 0.1 ? megabytes.toFixed(3) : megabytes.toFixed(1)} MB in ${(1000 * run.fetchSeconds).toFixed(0)} ms, positions to ${short(1e6 * step)} µm.`;
}
function small(text, kind = '') {
  const line = document.createElement('small');
  line.textContent = text;
  line.className = kind;
  return line;
}
let legendKey = '';
function describeLegend(places) {
  const mean = state.coloring === 'error' && state.still && places.every(Boolean) ? sampledValues() : [];
  const meanText = mean.length ? `, mean ${short(mean.reduce((a, b) => a + b, 0) / mean.length)} m` : '';
  const none = state.coloring === 'error' && !errorShown();
  const key = `${state.coloring} ${state.scale[state.coloring]} ${meanText} ${none} ${runs.map((run) => run.facts.run)}`;
  if (key === legendKey) return;
  legendKey = key;
  const legend = byId('legend'), row = (html, kind = '') => `<div class="${kind}">${html}</div>`;
  if (state.coloring === 'material') {
    const all = new Map(runs.flatMap((run) => run.facts.materials.map((m) => [`${m.name} ${m.color}`, m])));
    legend.innerHTML = [...all.values()].map(() => row('<i></i><span></span>')).join('');
    [...all.values()].forEach((m, i) => {
      legend.children[i].firstChild.style.background = `rgb(${m.color})`;
      legend.children[i].lastChild.textContent = m.name;
    });
    return;
  }
  if (none) {
    legend.innerHTML = row('No error: one run has ended before');
    return;
  }
  const most = state.scale[state.coloring], unit = state.coloring === 'speed' ? 'm/s' : 'm';
  const title = state.coloring === 'speed' ? 'Speed, mean between two frames' : `Error: distance to the other file${meanText}`;
  legend.innerHTML = row(title) + row('', 'scale') + row(`<span>0</span><span>${short(most / 2)}</span><span>${short(most)} ${unit}</span>`, 'ticks');
  legend.children[1].style.background = gradient(state.coloring);
}

// ---- choices ------------------------------------------------------------------------------------------------------
function choose(group, value, set) {
  for (const button of byId(group).children) {
    button.classList.toggle('on', button.dataset.value === value);
    button.setAttribute('aria-pressed', button.dataset.value === value);
  }
  set(value);
  redraw();
}
function setColoring(value) {
  if (value === 'error' && !errorPossible()) return;
  choose('coloring', value, () => { state.coloring = value; });
  byId('scale-row').style.display = value === 'material' ? 'none' : '';
  byId('scale-unit').textContent = value === 'speed' ? 'm/s' : 'm';
  byId('scale').value = state.scale[value] || '';
}
function setSlice(value) {
  choose('slice', value, () => { state.slice = value; });
  byId('slice-row').style.display = value === 'off' ? 'none' : '';
}
function savePicture() {
  state.still = true;
  draw();
  canvas.toBlob((blob) => {
    const link = document.createElement('a'), run = leader();
    link.href = URL.createObjectURL(blob);
    link.download = `${runs.map((r) => r.facts.name.replace(/\.[^.]*$/, '')).join('-')}-${run.place(state.time).k}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
}
function connectControls() {
  byId('play').onclick = () => play(!state.playing);
  byId('scrub').oninput = (e) => { play(false); setTime(leader().facts.times[Number(e.target.value)]); };
  byId('rate').onchange = (e) => { state.rate = Number(e.target.value); };
  byId('coloring').onclick = (e) => { if (e.target.dataset.value) setColoring(e.target.dataset.value); };
  byId('slice').onclick = (e) => { if (e.target.dataset.value) setSlice(e.target.dataset.value); };
  byId('scale').onchange = (e) => { state.scale[state.coloring] = Number(e.target.value); redraw(); };
  byId('fit').onclick = () => { fitScale(); redraw(); };
  for (const id of ['slice-at', 'size', 'obstacles', 'domain', 'shadows']) byId(id).oninput = redraw;
  byId('reset').onclick = () => { camera.reset(); redraw(); };
  byId('save').onclick = savePicture;
  byId('settings').onclick = (e) => e.currentTarget.setAttribute('aria-expanded', byId('panel').classList.toggle('open'));
  byId('live-play').onclick = () => commandAll(isRunning() ? 'pause' : 'play');
  byId('live-restart').onclick = () => commandAll('restart');
  const keys = {
    ' ': () => play(!state.playing), ArrowLeft: (e) => stepFrames(e.shiftKey ? -10 : -1), ArrowRight: (e) => stepFrames(e.shiftKey ? 10 : 1),
    Home: () => { play(false); setTime(0); }, End: () => { play(false); setTime(lastTime()); }, r: () => byId('reset').click(),
    s: savePicture, 1: () => setColoring('material'), 2: () => setColoring('speed'), 3: () => setColoring('error')
  };
  window.addEventListener('keydown', (e) => {
    const key = keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!key || e.ctrlKey || e.metaKey || e.altKey || e.target.type === 'number') return;
    e.preventDefault();
    key(e);
  });
  window.addEventListener('resize', redraw);
  connectPointer(canvas, () => ({ camera, panel: layout()[0] }), { redraw, reset: () => byId('reset').click() });
}
// ---- runs that are computed now -----------------------------------------------------------------------------------
const isRunning = () => runs.some((run) => run.state === 'running');
const goesOn = (run) => run.state === 'running' || run.state === 'paused';
async function commandAll(word) {
  state.refused = '';
  for (const run of runs.filter((one) => one.facts.live && (word === 'restart' || goesOn(one)))) {
    try {
      await command(run.side, word);
    } catch (error) {
      state.refused = error.message;  // until the next command
    }
  }
  await poll();
}
async function poll() {
  const all = await getStatus();
  if (all.some((one, side) => one.run !== runs[side].facts.run)) await loadRuns();
  all.forEach((one, side) => {
    const run = runs[side], atEnd = run.facts.live && state.time >= lastTime() - 1e-9 && run === leader();
    if (one.run !== run.facts.run) return;
    if (run.state !== one.state) redraw();
    Object.assign(run, { state: one.state, said: one.message });
    if (one.frames === run.ready) return;
    run.ready = one.frames;
    setTime(atEnd && !state.playing && state.follow ? lastTime() : state.time);
  });
  const live = runs.filter((run) => run.facts.live);
  if (!live.length) return;
  byId('live-play').textContent = !isRunning() && live.some(goesOn) ? 'Go on' : 'Pause';
  byId('live-play').disabled = !live.some(goesOn);
  byId('live-text').textContent = state.refused || live.map((run) => progressOf(run, all[run.side])).join('; ');
}
function progressOf(run, { state: word, message, frames, frame_seconds: seconds }) {
  return message || `${word}: ${frames - 1} of ${run.facts.times.length - 1} frames` +
    (seconds ? `, ${seconds < 1 ? `${(1000 * seconds).toFixed(0)} ms` : `${seconds.toFixed(1)} s`} a frame` : '');
}
async function pollForever() {
  try {
    await poll();
    say('');
  } catch (error) {
    say('The viewer has ended, or cannot be reached.\nStart it again and open the address it prints.');
  }
  setTimeout(pollForever, 150);
}

// ---- start --------------------------------------------------------------------------------------------------------
async function loadRuns() {
  const all = await getFacts(), low = [0, 1, 2].map((d) => Math.min(...all.map((f) => f.low[d])));
  const high = [0, 1, 2].map((d) => Math.max(...all.map((f) => f.high[d])));
  for (const run of runs) for (const frame of run.frames.values()) renderer.release(frame);
  const fresh = all.map((f, side) => new Run(side, f, () => setTime(state.time)));
  await Promise.all(fresh.map((run) => run.load()));
  runs = fresh;
  const old = camera, flat = all.every((f) => f.dimensions === 2);
  if (flat) low[2] = high[2] = all[0].plane ?? low[2];
  camera = new Camera(low, high, all[0].up, flat);
  if (old) Object.assign(camera, { yaw: old.yaw, pitch: old.pitch, zoom: old.zoom, shift: old.shift });
  runs.forEach((run, side) => renderer.setRun(side, run));
  renderer.setBox(camera);
  byId('live').hidden = !all.some((f) => f.live);
  byId('coloring').children[2].disabled = !errorPossible();
  byId('coloring-hint').textContent = runs.length < 2 ? 'Error needs a second file: graupel view A B.' :
    errorPossible() ? '' : `No error is shown: ${all[0].name} has ${all[0].particles} particles, ${all[1].name} ${all[1].particles}. It needs the same particles.`;
  if (state.coloring === 'error' && !errorPossible()) setColoring('material');
  document.title = `${all.map((f) => f.name).join(' | ')} - Graupel`;
  state.follow = all.some((f) => f.live);
  if (old) state.time = 0;
}
/** #frame=60&color=speed&slice=x:0.4&yaw=1&pitch=0.3&play=1 */
function applyAddress() {
  const words = new URLSearchParams(location.hash.slice(1)), [axis, share] = (words.get('slice') || 'off').split(':');
  if (share) byId('slice-at').value = share;
  setSlice(['x', 'y', 'z'].includes(axis) ? axis : 'off');
  setColoring(['speed', 'error'].includes(words.get('color')) ? words.get('color') : 'material');
  for (const name of ['yaw', 'pitch', 'zoom']) if (words.has(name)) camera[name] = Number(words.get(name));
  const frame = Number(words.get('frame') || 0), times = leader().facts.times;
  setTime(times[Math.max(0, Math.min(times.length - 1, frame))] || 0);
  if (words.get('play') === '1') play(true);
}
async function start() {
  try {
    renderer = new Renderer(canvas);
  } catch (error) {
    if (error.message !== 'no webgl2') throw error;
    root.dataset.view = 'no webgl2';
    say('This browser has no WebGL2, which the pictures need.\nUse a current Firefox, Chromium or Safari, or turn its hardware acceleration on.');
    return;
  }
  canvas.addEventListener('webglcontextlost', () => fail(new Error('The graphics driver gave up. Load the page again.')));
  await loadRuns();
  connectControls();
  applyAddress();
  setInterval(() => { state.pictures = pictureCount; pictureCount = 0; }, 1000);
  if (runs.some((run) => run.facts.live)) pollForever();
}
start().catch(fail);
