(() => {
  const data = JSON.parse(document.getElementById("plot-data").textContent);
  const whole = [data.start, data.end];
  let view = [...whole], cursor = null, head = null;
  const canvases = [...document.querySelectorAll("canvas.plot")];
  const replay = document.querySelector("iframe[title='Replay in 3D']");
  const LEFT = 46, BOTTOM = 20, TOP = 6, RIGHT = 8;

  const ticks = (low, high, most) => {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((k) => k * power >= rough);
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(+v.toPrecision(6));
    return found;
  };

  function draw(canvas, plot) {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio); pen.font = "12px system-ui, sans-serif"; pen.clearRect(0, 0, w, h);
    const n = plot.lines[0].y.length, dt = (data.end - data.start) / Math.max(1, n - 1);
    const first = Math.max(0, Math.floor((view[0] - data.start) / dt)), last = Math.min(n - 1, Math.ceil((view[1] - data.start) / dt));
    let top = 1e-9;
    for (const line of plot.lines) for (let k = first; k <= last; k++) top = Math.max(top, line.y[k]);
    top *= 1.08;
    const x = (t) => LEFT + (t - view[0]) / (view[1] - view[0]) * (w - LEFT - RIGHT);
    const y = (v) => h - BOTTOM - v / top * (h - BOTTOM - TOP);
    pen.strokeStyle = "#e6e8ec"; pen.fillStyle = "#566072"; pen.lineWidth = 1;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const v of ticks(0, top, 3)) { pen.beginPath(); pen.moveTo(LEFT, y(v)); pen.lineTo(w - RIGHT, y(v)); pen.stroke(); pen.fillText(v, LEFT - 5, y(v)); }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const t of ticks(view[0], view[1], w / 90)) pen.fillText(t + " s", x(t), h - BOTTOM + 5);
    pen.save(); pen.beginPath(); pen.rect(LEFT, 0, w - LEFT - RIGHT, h - BOTTOM + 1); pen.clip();
    for (const line of plot.lines) {
      pen.strokeStyle = line.color; pen.lineWidth = 1.4; pen.beginPath();
      for (let k = first; k <= last; k++) pen.lineTo(x(data.start + k * dt), y(line.y[k]));
      pen.stroke();
    }
    for (const [t, color] of [[head, "#c2473b"], [cursor, "#9aa3b2"]]) {
      if (t === null || t < view[0] || t > view[1]) continue;
      pen.strokeStyle = color; pen.lineWidth = 1.2; pen.beginPath(); pen.moveTo(x(t), 0); pen.lineTo(x(t), h - BOTTOM); pen.stroke();
    }
    pen.restore();
    const at = cursor === null ? head : cursor;
    if (at !== null) {
      const k = Math.min(n - 1, Math.max(0, Math.round((at - data.start) / dt)));
      canvas.previousElementSibling.querySelector("output").textContent =
        `${at.toFixed(2)} s: ` + plot.lines.map((line) => `${line.name} ${line.y[k]}`).join(", ") + ` ${plot.unit}`;
    }
  }

  const all = () => canvases.forEach((canvas, k) => draw(canvas, data.plots[k]));
  function show(low, high) {
    const span = Math.min(whole[1] - whole[0], Math.max(0.05, high - low));
    low = Math.min(Math.max(whole[0], low), whole[1] - span);
    view = [low, low + span]; all();
  }
  const time = (canvas, event) => {
    const box = canvas.getBoundingClientRect();
    return view[0] + (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT) * (view[1] - view[0]);
  };
  const zoom = (t, factor) => show(t - (t - view[0]) * factor, t + (view[1] - t) * factor);

  for (const canvas of canvases) {
    const held = new Map();
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey && Math.abs(event.deltaX) > Math.abs(event.deltaY)) return;
      event.preventDefault(); zoom(time(canvas, event), 1.0015 ** event.deltaY);
    }, { passive: false });
    canvas.addEventListener("dblclick", () => show(...whole));
    canvas.addEventListener("pointerdown", (event) => { held.set(event.pointerId, event); canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => { cursor = null; all(); });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (before && held.size === 1) {
        const moved = time(canvas, before) - time(canvas, event);
        held.set(event.pointerId, event); show(view[0] + moved, view[1] + moved); return;
      }
      if (before && held.size === 2) {
        const other = [...held.values()].find((one) => one.pointerId !== event.pointerId);
        const now = Math.abs(event.clientX - other.clientX), then = Math.abs(before.clientX - other.clientX);
        held.set(event.pointerId, event);
        if (now > 5 && then > 5) zoom((time(canvas, event) + time(canvas, other)) / 2, then / now);
        return;
      }
      cursor = time(canvas, event); all();
    });
  }
  document.getElementById("plot-all").addEventListener("click", () => show(...whole));
  addEventListener("resize", all);
  // The replay tells its time in its slider.
  setInterval(() => {
    const slider = replay && replay.contentDocument && replay.contentDocument.querySelector("[role=slider]");
    const now = slider ? data.start + parseFloat(slider.getAttribute("aria-valuenow")) : null;
    if (now !== head) { head = now; all(); }
  }, 100);
  all();
})();
