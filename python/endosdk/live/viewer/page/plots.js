// Small plots of what goes on, one line each.
const LENGTH = 300; // pictures
const SHORTEST = 30; // pictures over which the time axis reaches at first

export class Plots {
  constructor(parent) {
    this.parent = parent;
    this.lines = new Map();
  }

  // {name: [value, unit, floor, ceiling]}
  add(values) {
    for (const [name, [value, unit, floor, ceiling]] of Object.entries(values)) {
      if (!this.lines.has(name)) {
        const canvas = document.createElement("canvas");
        this.parent.append(canvas);
        this.lines.set(name, { canvas, history: [], unit, floor, ceiling });
      }
      const line = this.lines.get(name);
      line.history.push(value);
      if (line.history.length > LENGTH) line.history.shift();
      draw(name, line);
    }
  }
}

function draw(name, { canvas, history, unit, floor, ceiling }) {
  canvas.width = canvas.clientWidth;
  canvas.height = canvas.clientHeight;
  const context = canvas.getContext("2d");
  const known = history.filter((value) => value !== null);
  const top = ceiling ?? Math.max(1e-6, ...known) * 1.1;
  const [left, right, high, low] = [8, canvas.width - 60, 24, canvas.height - 6];
  const at = (value) => low - ((value - floor) / (top - floor)) * (low - high);
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = "#aaa";
  context.fillText(name, left, 15);
  context.fillText(`${top.toFixed(top < 1 ? 2 : top < 10 ? 1 : 0)} ${unit}`, right + 6, high + 4);
  context.fillText(`${floor}`, right + 6, low);
  context.strokeStyle = "#3a3a44";
  context.strokeRect(left, high, right - left, low - high);
  context.strokeStyle = "#4fd1ff";
  context.lineWidth = 1.5;
  context.beginPath();
  let pen = false;
  history.forEach((value, i) => {
    if (value === null) return void (pen = false);
    const x = left + (i / (Math.max(SHORTEST, history.length) - 1)) * (right - left);
    if (pen) context.lineTo(x, at(value));
    else context.moveTo(x, at(value));
    pen = true;
  });
  context.stroke();
  const last = history[history.length - 1];
  context.fillStyle = "#ebebeb";
  context.textAlign = "right";
  const text = last === null ? "not known" : `${last.toFixed(last < 10 ? 2 : 1)} ${unit}`;
  context.fillText(text, right, 15);
}
