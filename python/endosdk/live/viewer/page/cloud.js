// The points in 3-D, by WebGL. Turns about the middle of the surface.
const VERTEX = `
attribute vec3 place; attribute vec3 colour; uniform mat4 view; uniform float size; varying vec3 tint;
void main() { gl_Position = view * vec4(place, 1.0); gl_PointSize = max(1.0, size / gl_Position.w); tint = colour; }`;
const FRAGMENT = `precision mediump float; varying vec3 tint; void main() { gl_FragColor = vec4(tint, 1.0); }`;
const FIELD = 0.75; // tangent of half the field of view

export class Cloud {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl", { preserveDrawingBuffer: true });
    this.home(false);
    if (!this.gl) return; // no WebGL: the panel stays empty
    this.program = link(this.gl);
    this.places = this.gl.createBuffer();
    this.colours = this.gl.createBuffer();
    this.count = 0;
    canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
    canvas.onpointermove = (event) => event.buttons && this.drag(event);
    canvas.onwheel = (event) => {
      event.preventDefault();
      this.zoom *= Math.exp(event.deltaY / 600);
      this.draw();
    };
  }

  home(draw = true) {
    Object.assign(this, { yaw: 0.35, pitch: 0.25, zoom: 1, aside: [0, 0] });
    if (draw) this.draw();
  }

  drag(event) {
    if (event.shiftKey) {
      this.aside[0] += event.movementX / this.canvas.clientWidth;
      this.aside[1] -= event.movementY / this.canvas.clientHeight;
    } else {
      this.yaw += event.movementX / 150;
      this.pitch += event.movementY / 150;
    }
    this.draw();
  }

  show(facts, levels, picture) {
    if (!this.gl || !facts.camera) return;
    const { fx, fy, cx, cy } = facts.camera;
    const { columns, thin, map } = facts;
    const places = [];
    const colours = [];
    // Beyond twice the far end of the scale are a few points that would shrink all others.
    const farthest = 2 * map.high;
    for (let i = 0; i < levels.length; i++) {
      const z = levels[i] * map.step;
      if (!z || z > farthest) continue;
      const x = (i % columns) * thin;
      const y = Math.floor(i / columns) * thin;
      places.push(((x - cx) / fx) * z, ((y - cy) / fy) * z, z);
      const at = 4 * (y * picture.width + x);
      colours.push(picture.data[at], picture.data[at + 1], picture.data[at + 2]);
    }
    this.middle = (map.low + map.high) / 2;
    this.reach = Math.max(map.high - map.low, (picture.width / fx) * this.middle) / 2;
    this.spacing = (thin / fx) * this.middle;
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.colours);
    gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(colours), gl.DYNAMIC_DRAW);
    this.count = places.length / 3;
    this.draw();
  }

  draw() {
    const { gl, canvas } = this;
    if (!gl || this.middle === undefined) return; // nothing was shown yet
    canvas.width = canvas.clientWidth;
    canvas.height = canvas.clientHeight;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.07, 0.07, 0.08, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.program, "view"), false, this.matrix());
    const pixels = (1.6 * this.spacing * canvas.height) / (2 * FIELD);
    gl.uniform1f(gl.getUniformLocation(this.program, "size"), pixels);
    attribute(gl, this.program, "place", this.places, gl.FLOAT, false);
    attribute(gl, this.program, "colour", this.colours, gl.UNSIGNED_BYTE, true);
    gl.drawArrays(gl.POINTS, 0, this.count);
  }

  // Column-major: world (y down, z forward) turned about the middle, moved in front of the eye, projected.
  matrix() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const away = (this.reach / FIELD) * 1.15 * this.zoom;
    const aspect = this.canvas.width / this.canvas.height;
    // Rows of the rotation; the eye looks along +z, y is down.
    const rows = [
      [cy, 0, sy],
      [sp * sy, cp, -sp * cy],
      [-cp * sy, sp, cp * cy],
    ];
    const moved = rows.map((row) => -row[2] * this.middle);
    moved[2] += away;
    const near = away / 100;
    const far = away + 20 * this.reach;
    const sx = 1 / (FIELD * aspect);
    const sv = -1 / FIELD;
    const a = (far + near) / (far - near);
    const b = (-2 * far * near) / (far - near);
    const out = new Float32Array(16);
    for (let j = 0; j < 4; j++) {
      const [x, y, z] = rows.map((row, i) => (j < 3 ? row[j] : moved[i]));
      out[4 * j] = sx * x + 2 * this.aside[0] * z;
      out[4 * j + 1] = sv * y + 2 * this.aside[1] * z;
      out[4 * j + 2] = a * z + (j === 3 ? b : 0);
      out[4 * j + 3] = z;
    }
    return out;
  }
}

function link(gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

function attribute(gl, program, name, buffer, type, normalized) {
  const place = gl.getAttribLocation(program, name);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, 3, type, normalized, 0, 0);
}
