// Points in 3D: drag turns, right drag or Ctrl shifts, the wheel zooms, a click sends its ray.
const STILL = 4;
const VERTEX = `#version 300 es
in vec3 place; in vec3 color; uniform mat4 view; uniform float size; uniform vec4 own; out vec3 shade;
void main() { gl_Position = view * vec4(place, 1.0); gl_PointSize = clamp(size / gl_Position.w, 1.6, 9.0); shade = own.a > 0.5 ? own.rgb : color; }`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 shade; out vec4 pixel; void main() { pixel = vec4(shade, 1.0); }`;
const sub = (a, b) => a.map((v, i) => v - b[i]), dot = (a, b) => a.reduce((s, v, i) => s + v * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const n = Math.hypot(...a) || 1; return a.map(v => v / n); };

export default {
  template: `
  <div class="cv" ref="box" @wheel.prevent="wheel" @pointerdown="down" @pointermove="move" @pointerup="up" @contextmenu.prevent>
    <canvas ref="canvas"></canvas>
    <div v-if="failed" class="cv-failed">{{ failed }}</div>
    <div v-if="busy" class="pv-busy"><span></span>{{ busy }}</div>
  </div>`,
  props: {points: String, colors: String, shapes: Array, eye: Array, zenith: Array, reach: Number, busy: String},
  data: () => ({failed: '', held: null}),
  watch: { colors() { this.fetchColors(); }, shapes() { this.fillLines(); this.draw(); } },
  async mounted() {
    const gl = this.gl = this.$refs.canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
    if (!gl) { this.failed = 'This browser shows no WebGL2; pick in the range image.'; return; }
    this.target = [0, 0, 0]; this.upward = unit(this.zenith); this.frame(this.eye);
    this.program = this.built(gl);
    this.buffers = {place: gl.createBuffer(), color: gl.createBuffer(), line: gl.createBuffer()};
    this.lines = []; this.count = 0;
    const places = new Float32Array(await (await fetch(this.points)).arrayBuffer());
    this.count = places.length / 3;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.place); gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
    await this.fetchColors();
    this.fillLines();
    this.seen = new ResizeObserver(() => this.draw()); this.seen.observe(this.$refs.box);
    this.draw();
  },
  unmounted() { if (this.seen) this.seen.disconnect(); },
  methods: {
    built(gl) {
      const p = gl.createProgram();
      for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s); gl.attachShader(p, s);
      }
      gl.bindAttribLocation(p, 0, 'place'); gl.bindAttribLocation(p, 1, 'color'); gl.linkProgram(p);
      if (!gl.getProgramParameter(p, gl.LINK_STATUS)) this.failed = gl.getProgramInfoLog(p);
      return p;
    },
    async fetchColors() {
      const gl = this.gl;
      if (!gl || !this.buffers) return;
      const colors = new Uint8Array(await (await fetch(this.colors)).arrayBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.color); gl.bufferData(gl.ARRAY_BUFFER, colors, gl.STATIC_DRAW);
      this.draw();
    },
    fillLines() {
      const gl = this.gl;
      if (!gl || !this.buffers) return;
      const values = []; this.lines = [];
      for (const s of this.shapes) for (const line of s.lines) {
        const rgb = [1, 3, 5].map(i => parseInt(s.color.slice(i, i + 2), 16) / 255);
        this.lines.push({start: values.length / 3, count: line.length, rgb});
        for (const p of line) values.push(...p);
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.line); gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    },
    frame(eye) {
      const arm = sub(eye, this.target); this.distance = Math.hypot(...arm) || 1;
      const a = unit(arm), u = this.upward;
      this.side = unit(cross(Math.abs(u[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], u)); this.front = cross(this.side, u);
      this.azimuth = Math.atan2(dot(a, this.side), dot(a, this.front)); this.elevation = Math.asin(Math.min(Math.max(dot(a, u), -1), 1));
    },
    arm() {
      const c = Math.cos(this.elevation), s = Math.sin(this.elevation), x = Math.sin(this.azimuth), y = Math.cos(this.azimuth);
      return this.side.map((v, i) => c * (x * v + y * this.front[i]) + s * this.upward[i]);
    },
    axes() { const back = this.arm(), right = unit(cross(this.upward, back)); return {back, right, above: cross(back, right)}; },
    eyeNow() { const a = this.arm(); return this.target.map((v, i) => v + this.distance * a[i]); },
    draw() {
      if (this.due) return;
      this.due = requestAnimationFrame(() => { this.due = 0; this.paint(); });
    },
    paint() {
      const gl = this.gl, canvas = this.$refs.canvas, box = this.$refs.box;
      if (!gl || !box || !box.clientWidth) return;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      canvas.width = box.clientWidth * ratio; canvas.height = box.clientHeight * ratio;
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0.086, 0.102, 0.129, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
      gl.useProgram(this.program);
      gl.uniformMatrix4fv(gl.getUniformLocation(this.program, 'view'), false, this.matrix());
      gl.uniform1f(gl.getUniformLocation(this.program, 'size'), 0.006 * this.reach * canvas.height);
      const own = gl.getUniformLocation(this.program, 'own');
      gl.uniform4f(own, 0, 0, 0, 0);
      gl.enableVertexAttribArray(0); gl.enableVertexAttribArray(1);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.place); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.color); gl.vertexAttribPointer(1, 3, gl.UNSIGNED_BYTE, true, 0, 0);
      gl.drawArrays(gl.POINTS, 0, this.count);
      gl.disableVertexAttribArray(1); gl.vertexAttrib3f(1, 1, 1, 1); gl.disable(gl.DEPTH_TEST);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.line); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      for (const line of this.lines) { gl.uniform4f(own, ...line.rgb, 1); gl.drawArrays(gl.LINE_STRIP, line.start, line.count); }
    },
    matrix() {
      const {back, right, above} = this.axes(), eye = this.eyeNow(), box = this.$refs.box;
      const f = 1 / Math.tan(0.5 * 0.9), near = this.distance * 0.01, far = this.distance + 20 * this.reach, ratio = box.clientWidth / box.clientHeight;
      // The depth of p is back . (eye - p), since back points to the eye.
      const scale = (far + near) / (far - near);
      const rows = [right.map(v => v * f / ratio), above.map(v => v * f), back.map(v => -v * scale), back.map(v => -v)];
      const last = [-dot(rows[0], eye), -dot(rows[1], eye), dot(back, eye) * scale - 2 * far * near / (far - near), dot(back, eye)];
      return new Float32Array([0, 1, 2].flatMap(i => rows.map(r => r[i])).concat(last));
    },
    wheel(e) { this.distance *= Math.exp(e.deltaY * 0.0012); this.draw(); },
    down(e) { this.$refs.box.setPointerCapture(e.pointerId); this.held = {x: e.clientX, y: e.clientY, button: e.button, ctrl: e.ctrlKey, moved: false, far: 0}; },
    move(e) {
      const h = this.held;
      if (!h) return;
      const dx = e.clientX - h.x, dy = e.clientY - h.y;
      h.moved = h.moved || Math.hypot(dx, dy) > STILL;
      if (!h.moved) return;
      h.x = e.clientX; h.y = e.clientY;
      if (h.button === 2 || h.ctrl) {
        const {right, above} = this.axes(), step = this.distance * 2 * Math.tan(0.45) / this.$refs.box.clientHeight;
        this.target = this.target.map((v, i) => v - step * (dx * right[i] - dy * above[i]));
      } else {
        this.azimuth -= dx * 0.006; this.elevation = Math.min(Math.max(this.elevation + dy * 0.006, -1.5), 1.5);
      }
      this.draw();
    },
    up(e) {
      const h = this.held; this.held = null;
      if (!h || h.moved || h.button !== 0) return;
      const b = this.$refs.box.getBoundingClientRect(), {back, right, above} = this.axes(), t = Math.tan(0.45);
      const x = ((e.clientX - b.left) / b.width * 2 - 1) * t * b.width / b.height, y = (1 - (e.clientY - b.top) / b.height * 2) * t;
      this.$emit('pick', {origin: this.eyeNow(), direction: back.map((v, i) => -v + x * right[i] + y * above[i]), again: e.shiftKey});
    },
  },
};
