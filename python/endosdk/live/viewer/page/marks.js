// What is pointed at: points, lines and outlines over the left view, with what the server measured.
const HINTS = {
  point: "Click a pixel: its depth with the standard error.",
  distance: "Click two pixels, or more for a path; double click ends it.",
  area: "Click the corners of an outline; double click closes it.",
};
const COLOURS = ["#ffd23f", "#4fd1ff", "#ff8a5c", "#9be564", "#e58aff"];
const LEAST = { point: 1, distance: 2, area: 3 };

export class Marks {
  constructor(canvas, list, hint, measure) {
    Object.assign(this, { canvas, list, hint, measure, tool: "point", open: [], done: [] });
    canvas.onclick = (event) => this.click(event);
    canvas.ondblclick = () => this.finish();
  }

  take(tool) {
    this.tool = tool;
    this.open = [];
    this.hint.textContent = HINTS[tool];
    this.draw();
  }

  resize(width, height) {
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.draw();
  }

  clear() {
    this.open = [];
    this.done = [];
    this.draw();
    this.write();
  }

  click(event) {
    if (event.detail > 1) return; // the second click of a double click
    const box = this.canvas.getBoundingClientRect();
    // Pixel centres are whole numbers.
    const x = ((event.clientX - box.left) / box.width) * this.canvas.width - 0.5;
    const y = ((event.clientY - box.top) / box.height) * this.canvas.height - 0.5;
    this.open.push([x, y]);
    if (this.tool === "point") this.finish();
    this.draw();
  }

  finish() {
    if (this.open.length < LEAST[this.tool]) return;
    this.done.push({ kind: this.tool, pixels: this.open, text: "..." });
    this.open = [];
    this.ask(this.done[this.done.length - 1]);
  }

  // A new picture: everything is measured again.
  again() {
    for (const mark of this.done) this.ask(mark);
  }

  ask(mark) {
    this.measure(mark.kind, mark.pixels, (message) => {
      mark.text = message.measured ? message.measured.map(said).join("; ") : message.refused;
      mark.values = message.measured;
      this.draw();
      this.write();
    });
  }

  write() {
    this.list.replaceChildren(
      ...this.done.map((mark, i) => {
        const item = document.createElement("li");
        item.textContent = mark.text;
        item.style.color = COLOURS[i % COLOURS.length];
        if (mark.values) item.dataset.values = JSON.stringify(mark.values);
        return item;
      }),
    );
  }

  draw() {
    const context = this.canvas.getContext("2d");
    const unit = this.canvas.width / 480;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.lineWidth = 1.5 * unit;
    context.font = `${13 * unit}px system-ui, sans-serif`;
    const all = [...this.done, { kind: this.tool, pixels: this.open }];
    all.forEach((mark, i) => {
      context.strokeStyle = context.fillStyle = COLOURS[i % COLOURS.length];
      context.beginPath();
      mark.pixels.forEach(([x, y], j) => (j ? context.lineTo(x + 0.5, y + 0.5) : context.moveTo(x + 0.5, y + 0.5)));
      if (mark.kind === "area" && mark.text) context.closePath();
      context.stroke();
      for (const [x, y] of mark.pixels) {
        context.beginPath();
        context.arc(x + 0.5, y + 0.5, 3 * unit, 0, 2 * Math.PI);
        context.stroke();
      }
      if (mark.text) context.fillText(`${i + 1}`, mark.pixels[0][0] + 6 * unit, mark.pixels[0][1] - 6 * unit);
    });
  }
}

function said({ name, value, standard_error, interval, unit, remark }) {
  const digits = standard_error < 0.1 ? 2 : 1;
  const [low, high] = interval.map((each) => each.toFixed(digits));
  const error = standard_error.toFixed(digits);
  return `${name} ${value.toFixed(digits)} ± ${error} ${unit} (95 %: ${low} .. ${high})${remark ? `, ${remark}` : ""}`;
}
