// What the program serves: facts, state of the runs, types, obstacles, frames. Frames are ranges of bytes of one
// resource, fetched when they are needed and ahead of that, and kept up to a limit.
const bytesKept = 768e6;   // of frames, all sides together
const fetchesAtOnce = 4;   // of a side
const headerWords = 9;     // low[3], step[3], time, left out, run
export const absent = 65535;

async function get(path, headers = {}) {
  const answer = await fetch(path, { headers, cache: 'no-store' });
  if (!answer.ok) throw new Error(`${path}: ${await answer.text()}`);
  return answer;
}
export const facts = async () => (await (await get('facts.json')).json()).sides;
export const status = async () => (await (await get('status.json')).json()).sides;
/** Of a live run: play, pause, restart. */
export async function command(side, word) {
  const answer = await fetch(`${side}/${word}`, { method: 'POST' });
  if (!answer.ok) throw new Error(await answer.text());
}

/** [{moving, count, first}] and all corners: position f32 x 3, normal i8 x 4. */
async function obstacles(side) {
  const bytes = await (await get(`${side}/obstacles`)).arrayBuffer();
  const head = new DataView(bytes), parts = [];
  let first = 0;
  for (let i = 0; i < head.getUint32(0, true); ++i) {
    const count = head.getUint32(4 + 8 * i, true);
    parts.push({ count, first, moving: head.getInt32(8 + 8 * i, true) });
    first += count;
  }
  return { parts, corners: new Uint8Array(bytes, 4 + 8 * parts.length) };
}

function decode(bytes, k, run) {
  const numbers = new Float32Array(bytes, 0, headerWords), words = new Uint32Array(bytes, 0, headerWords);
  const poseNumbers = 12 * run.facts.moving_obstacles;
  return {
    k, low: numbers.slice(0, 3), step: numbers.slice(3, 6), leftOut: words[7], run: words[8],
    poses: new Float32Array(bytes, 4 * headerWords, poseNumbers),
    positions: new Uint16Array(bytes, 4 * (headerWords + poseNumbers)), buffer: null
  };
}

/** One side: its facts and its frames. */
export class Run {
  constructor(side, itsFacts, onFrame) {
    this.side = side;
    this.facts = itsFacts;
    this.onFrame = onFrame;
    this.frames = new Map();   // least lately needed first
    this.fetching = new Set();
    this.wanted = [];
    this.ready = itsFacts.live ? 0 : itsFacts.times.length;
    this.problem = '';
    this.fetchSeconds = 0;
  }
  async load() {
    this.types = new Uint8Array(await (await get(`${this.side}/types`)).arrayBuffer());
    this.obstacles = await obstacles(this.side);
  }
  /** Frames in the order of their need; those that are not there yet are fetched. */
  want(frames) {
    this.wanted = frames;
    for (const k of frames) {
      const frame = this.frames.get(k);
      if (!frame) continue;
      this.frames.delete(k);
      this.frames.set(k, frame);
    }
    this.fetchMore();
  }
  fetchMore() {
    for (const k of this.wanted) {
      if (this.fetching.size >= fetchesAtOnce) return;
      if (k < this.ready && !this.frames.has(k) && !this.fetching.has(k)) this.fetchFrame(k);
    }
  }
  async fetchFrame(k) {
    this.fetching.add(k);
    const size = this.facts.record_bytes, start = performance.now();
    try {
      const range = `bytes=${k * size}-${(k + 1) * size - 1}`;
      const bytes = await (await get(`${this.side}/frames`, { Range: range })).arrayBuffer();
      const frame = bytes.byteLength === size ? decode(bytes, k, this) : null;
      this.fetchSeconds = (performance.now() - start) / 1000;
      if (frame && frame.run === this.facts.run) this.frames.set(k, frame);
      this.problem = '';
    } catch (error) {
      this.problem = error.message;
    }
    this.fetching.delete(k);
    this.onFrame();
    if (!this.problem) this.fetchMore();
  }
  /** Drops what was not needed for longest; `release` frees what a frame holds. */
  trim(sides, release) {
    const most = Math.max(4, Math.floor(bytesKept / sides / this.facts.record_bytes));
    for (const [k, frame] of this.frames) {
      if (this.frames.size <= most) return;
      if (this.wanted.includes(k)) continue;
      release(frame);
      this.frames.delete(k);
    }
  }
  /** The frame at or before a time, and how far the time is on the way to the next one. */
  place(time) {
    const times = this.facts.times, last = Math.max(0, this.ready - 1);
    let low = 0, high = last;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-9) low = middle; else high = middle - 1;
    }
    const next = Math.min(low + 1, last), gap = times[next] - times[low];
    return { k: low, next, blend: gap > 0 ? Math.max(0, Math.min(1, (time - times[low]) / gap)) : 0 };
  }
}
