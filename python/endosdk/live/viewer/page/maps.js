// The map in colours, with its scale.
const REASONS_SHADE = 0.45; // colour of a reason over the gray of a pixel without value
const GRAY = 70;

// The colour of a reason as the map shows it.
export const shaded = (colour) => colour.map((c) => Math.round(GRAY + REASONS_SHADE * (c - GRAY)));

export function drawMap(canvas, facts, levels, causes, legend) {
  const { columns, rows, map } = facts;
  canvas.width = columns;
  canvas.height = rows;
  const picture = new ImageData(columns, rows);
  const colourOf = reasonColours(legend.reasons);
  const scale = (255 * map.step) / Math.max(map.high - map.low, 1e-9);
  const offset = (255 * map.low) / Math.max(map.high - map.low, 1e-9);
  for (let i = 0; i < levels.length; i++) {
    const colour = levels[i]
      ? legend.ramp[Math.max(0, Math.min(255, Math.round(levels[i] * scale - offset)))]
      : colourOf[causes[i]];
    picture.data.set(colour, 4 * i);
    picture.data[4 * i + 3] = 255;
  }
  canvas.getContext("2d").putImageData(picture, 0, 0);
}

// One colour for each of the 256 sets of reasons: that of the highest bit, shaded.
function reasonColours(reasons) {
  return Array.from({ length: 256 }, (_, bits) => {
    const present = reasons.filter(({ bit }) => bits & bit);
    if (!present.length) return [GRAY, GRAY, GRAY];
    return shaded(present[present.length - 1].colour);
  });
}

// Without numbers where no pixel has a value.
export function drawScale(canvas, map, ramp, known) {
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const top = 10;
  const tall = height - 2 * top;
  for (let y = 0; y < tall; y++) {
    context.fillStyle = `rgb(${ramp[Math.round(255 * (1 - y / (tall - 1)))]})`;
    context.fillRect(0, top + y, 16, 1);
  }
  context.fillStyle = "#ebebeb";
  context.font = "12px system-ui, sans-serif";
  context.textBaseline = "middle";
  if (!known) return;
  const digits = map.high - map.low > 20 ? 0 : map.high - map.low > 2 ? 1 : 2;
  for (let i = 0; i <= 5; i++) {
    const value = map.high + (i / 5) * (map.low - map.high);
    context.fillText(value.toFixed(digits), 21, top + (i / 5) * (tall - 1));
  }
}
