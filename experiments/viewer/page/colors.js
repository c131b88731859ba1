// Scales of colours for numbers, and what the legend says.
const scales = {
  speed: ['#2b2f77', '#2c5fa8', '#2a8fb5', '#3fb8a0', '#8fd16a', '#e6dc4f', '#ffb347', '#ff8142'],  // slow to fast
  error: ['#59616e', '#7d7f86', '#b59a78', '#e0a44f', '#f07f3c', '#e4483a', '#b8154e']              // right to wrong
};
const parse = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));

/** 256 colours, RGBA bytes. */
export function scaleBytes(name) {
  const stops = scales[name].map(parse), out = new Uint8Array(1024);
  for (let i = 0; i < 256; ++i) {
    const at = i / 255 * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
    for (let d = 0; d < 3; ++d) out[4 * i + d] = stops[k][d] + (at - k) * (stops[k + 1][d] - stops[k][d]);
    out[4 * i + 3] = 255;
  }
  return out;
}
export const gradient = (name) => `linear-gradient(90deg, ${scales[name].join(', ')})`;

/** Colours by the particles' bytes, RGBA bytes. */
export function paletteBytes(materials) {
  const out = new Uint8Array(1024).fill(190);
  for (const m of materials) out.set([...m.color, 255], 4 * m.type);
  return out;
}

/** 1, 2 or 5 times a power of ten, not below x. */
export function roundUp(x) {
  if (!(x > 0) || !isFinite(x)) return 1;
  const power = 10 ** Math.floor(Math.log10(x));
  return [1, 2, 5, 10].map((m) => m * power).find((y) => y >= 0.999 * x);
}
export const short = (x) => (x === 0 ? '0' : Math.abs(x) >= 0.01 && Math.abs(x) < 1e4 ? String(+x.toPrecision(3)) : x.toExponential(1));
