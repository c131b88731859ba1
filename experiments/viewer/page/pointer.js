// The pointer: turns, shifts and scales the picture.
/** shown(): the camera and the first panel [x, y, width, height], shares of the canvas. */
export function connectPointer(canvas, shown, { redraw, reset }) {
  const pointers = new Map();
  const spread = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener('pointerdown', (e) => {
    canvas.setPointerCapture(e.pointerId);
    canvas.focus({ preventScroll: true });
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, (e) => pointers.delete(e.pointerId));
  canvas.addEventListener('pointermove', (e) => {
    const from = pointers.get(e.pointerId), { camera, panel: [, , width, height] } = shown();
    if (!from) return;
    const before = pointers.size === 2 ? spread() : 0, x = e.clientX - from.x, y = e.clientY - from.y;
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    const h = height * canvas.clientHeight, aspect = width * canvas.clientWidth / h;
    if (pointers.size === 2) {
      camera.scale(before / spread());
      camera.pan(x / 2, y / 2, h, aspect);
    } else if (e.shiftKey || e.buttons === 2 || e.buttons === 4 || camera.flat) camera.pan(x, y, h, aspect);
    else camera.orbit(x, y);
    redraw();
  });
  canvas.addEventListener('contextmenu', (e) => e.preventDefault());
  canvas.addEventListener('dblclick', reset);
  canvas.addEventListener('wheel', (e) => {
    e.preventDefault();
    shown().camera.scale(Math.exp(0.0012 * e.deltaY));
    redraw();
  }, { passive: false });
}
