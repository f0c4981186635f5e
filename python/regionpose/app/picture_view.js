// A picture to click on: zoom, pan, loupe, outlines, polygons with vertices to drag. Pixels are OpenCV's: an integer is a pixel's center.
// Modes: click, hide, polygon, and cut, a polygon that ends with the stroke that draws all of it.
const STILL = 4, NEAR = 10, STROKE = 3, LOUPE = 176, POWER = 5;

export default {
  template: `
  <div class="pv" ref="box" :class="'pv-' + mode" @wheel.prevent="wheel" @pointerdown="down" @pointermove="move"
       @pointerup="up" @pointerleave="leave" @dblclick.prevent="close" @contextmenu.prevent>
    <div class="pv-stage" :style="stage">
      <img ref="img" class="pv-picture" :src="src" draggable="false" :class="{'pv-crisp': zoom > 4}" @load="loaded" alt="">
      <img v-if="over" ref="over" class="pv-over" :src="over" draggable="false" :class="{'pv-crisp': zoom > 4}" :style="{opacity}" alt="">
      <svg :viewBox="'-0.5 -0.5 ' + width + ' ' + height" preserveAspectRatio="none">
        <g v-if="showOutlines">
          <path v-for="s in drawn" :key="'f' + s.key" :d="path(s.rings, true)" :fill="s.color" :fill-opacity="s.selected ? 0.24 : 0.13"
                fill-rule="evenodd" :stroke="s.color" :stroke-width="s.selected ? 2.6 : 1.8" vector-effect="non-scaling-stroke"/>
          <path v-for="s in lined" :key="'l' + s.key" :d="path(s.lines, false)" fill="none" :stroke="s.color"
                :stroke-width="s.selected ? 2.6 : 1.8" vector-effect="non-scaling-stroke"/>
          <path v-for="s in drawn" :key="'h' + s.key" :d="hiddenPath(s)" fill="none" stroke="#11151b" stroke-width="3.4"
                stroke-dasharray="3 5" vector-effect="non-scaling-stroke"/>
        </g>
        <g v-if="showProjected">
          <template v-for="(s, i) in projected" :key="'p' + i">
            <path :d="path(s.lines, false)" fill="none" stroke="#0b0e13" stroke-opacity="0.75" stroke-width="3.6" vector-effect="non-scaling-stroke"/>
            <path :d="path(s.lines, false)" fill="none" stroke="#fff" stroke-width="1.7" stroke-dasharray="7 5" vector-effect="non-scaling-stroke"/>
          </template>
        </g>
        <path v-if="covered.length" :d="path(covered.map(i => [draft[i], draft[i + 1]]), false)" fill="none" stroke="#11151b" stroke-width="4.4"
              vector-effect="non-scaling-stroke"/>
        <path v-if="draft.length" :d="path([draft.concat(cursor ? [cursor] : [])], false)" fill="none" stroke="#fff" stroke-width="2"
              stroke-dasharray="5 4" vector-effect="non-scaling-stroke"/>
      </svg>
      <template v-for="(v, i) in draft" :key="'d' + i">
        <div v-if="!(covered.includes(i - 1) && covered.includes(i))" class="pv-dot pv-first" :style="at(v)" :class="{'pv-big': i === 0 && draft.length > 2}"></div>
      </template>
      <template v-if="edited && mode === 'click'">
        <template v-for="(ring, r) in edited.rings">
          <div v-for="(v, i) in ring" :key="'v' + r + '_' + i" class="pv-dot pv-vertex" :style="at(v)"
               :data-ring="r" :data-index="i" title="drag to move, right-click to remove"></div>
          <div v-for="(v, i) in ring" :key="'m' + r + '_' + i" class="pv-dot pv-middle" :style="at(middle(ring, i))"
               :data-ring="r" :data-index="i" data-insert="1" title="drag to add a vertex"></div>
        </template>
      </template>
      <div v-for="s in labeled" :key="'n' + s.key" class="pv-name" :data-key="s.key" :style="{...at(s.place), '--c': s.color}" :class="{'pv-on': s.selected}">{{ s.name }}</div>
    </div>
    <canvas v-show="loupe && glass" ref="loupe" class="pv-loupe" :class="{'pv-left': glassLeft}" width="${LOUPE}" height="${LOUPE}"></canvas>
    <div v-if="busy" class="pv-busy"><span></span>{{ busy }}</div>
  </div>`,
  props: {src: String, width: Number, height: Number, shapes: Array, projected: Array, mode: String, loupe: Boolean,
          showProjected: Boolean, showOutlines: Boolean, busy: String, least: Number, over: String, opacity: Number},
  data: () => ({zoom: 1, left: 0, top: 0, fit: 1, held: null, draft: [], covered: [], cursor: null, glass: false, glassLeft: false, edited: null, hover: null}),
  computed: {
    stage() {
      return {width: this.width * this.zoom + 'px', height: this.height * this.zoom + 'px', transform: `translate(${this.left}px,${this.top}px)`};
    },
    drawn() {
      return this.shapes.filter(s => s.rings).map(s => (this.edited && s.key === this.edited.key ? {...s, rings: this.edited.rings, hidden: this.edited.hidden} : s));
    },
    drafts() { return this.mode === 'polygon' || this.mode === 'cut'; },
    lined() { return this.shapes.filter(s => s.lines); },
    labeled() {
      if (!this.showOutlines) return [];
      return this.shapes.map(s => ({...s, place: this.topOf(s.rings || s.lines)})).filter(s => s.place);
    },
  },
  watch: {
    shapes: { handler() { this.takeUp(); }, deep: false },
    mode() { this.forget(); },
    width() { this.reset(); },
    height() { this.reset(); },
  },
  mounted() {
    this.takeUp();
    this.seen = new ResizeObserver(() => this.fitted());
    this.seen.observe(this.$refs.box);
    this.keys = e => this.key(e);
    window.addEventListener('keydown', this.keys);
  },
  unmounted() { this.seen.disconnect(); window.removeEventListener('keydown', this.keys); },
  methods: {
    takeUp() {
      const s = this.shapes.find(s => s.selected && s.polygon);
      this.edited = s ? {key: s.key, rings: s.rings.map(r => r.map(v => [...v])), hidden: s.hidden.map(h => [...h])} : null;
    },
    fitted() {
      const b = this.$refs.box, w = b.clientWidth, h = b.clientHeight;
      if (!w || !h) return;
      const old = this.fit;
      // A long strip fills a part of the height at least: the rest is a drag away.
      this.fit = Math.max(Math.min(w / this.width, h / this.height), Math.min((this.least || 0) * h / this.height, h / this.height));
      if (this.zoom !== old && this.touched) return;
      this.zoom = this.fit;
      this.left = (w - this.width * this.zoom) / 2;
      this.top = (h - this.height * this.zoom) / 2;
    },
    reset() { this.touched = false; this.zoom = this.fit; this.fitted(); },
    place(e) {
      const b = this.$refs.box.getBoundingClientRect();
      return [(e.clientX - b.left - this.left) / this.zoom - 0.5, (e.clientY - b.top - this.top) / this.zoom - 0.5];
    },
    inside(p) { return p[0] >= -0.5 && p[1] >= -0.5 && p[0] <= this.width - 0.5 && p[1] <= this.height - 0.5; },
    clamped(p) { return [Math.min(Math.max(p[0], -0.5), this.width - 0.5), Math.min(Math.max(p[1], -0.5), this.height - 0.5)]; },
    // Who aims at the border misses it by some pixels of the screen: that is a click on the pixel at the border.
    near(p) {
      const q = [Math.min(Math.max(p[0], 0), this.width - 1), Math.min(Math.max(p[1], 0), this.height - 1)];
      return this.inside(p) || Math.hypot(q[0] - p[0], q[1] - p[1]) * this.zoom <= NEAR + this.zoom ? q : null;
    },
    at(v) { return {left: (v[0] + 0.5) * this.zoom + 'px', top: (v[1] + 0.5) * this.zoom + 'px'}; },
    middle(ring, i) { const n = ring[(i + 1) % ring.length]; return [(ring[i][0] + n[0]) / 2, (ring[i][1] + n[1]) / 2]; },
    topOf(rings) {
      let best = null;
      for (const ring of rings) for (const v of ring) if (!best || v[1] < best[1]) best = v;
      return best;
    },
    path(rings, closed) { return rings.map(r => 'M' + r.map(v => v[0] + ' ' + v[1]).join('L') + (closed ? 'Z' : '')).join(''); },
    hiddenPath(s) {
      return (s.hidden || []).map((edges, r) => edges.map(i => {
        const ring = s.rings[r], a = ring[i], b = ring[(i + 1) % ring.length];
        return a ? `M${a[0]} ${a[1]}L${b[0]} ${b[1]}` : '';
      }).join('')).join('');
    },
    wheel(e) {
      const b = this.$refs.box.getBoundingClientRect(), x = e.clientX - b.left, y = e.clientY - b.top;
      const zoom = Math.min(Math.max(this.zoom * Math.exp(-e.deltaY * 0.0016), this.fit * 0.8), 60);
      this.left = x - (x - this.left) * zoom / this.zoom;
      this.top = y - (y - this.top) * zoom / this.zoom;
      this.zoom = zoom; this.touched = true;
      this.look(e);
    },
    down(e) {
      this.$refs.box.setPointerCapture(e.pointerId);
      const dot = e.target.closest('.pv-vertex, .pv-middle'), name = e.target.closest('.pv-name');
      // A stroke may begin beside the picture: it is drawn along the border there.
      const draws = this.drafts && e.shiftKey && e.button === 0;
      this.held = {x: e.clientX, y: e.clientY, left: this.left, top: this.top, moved: false, button: e.button, draws, name};
      if (!dot || !this.edited) return;
      const ring = +dot.dataset.ring, index = +dot.dataset.index;
      if (e.button === 2) { this.drop(ring, index, !dot.dataset.insert); this.held = null; return; }
      this.held.inserts = !!dot.dataset.insert;
      this.held.vertex = [ring, this.held.inserts ? index + 1 : index];
    },
    insert(ring, index) {
      this.edited.rings[ring].splice(index + 1, 0, this.middle(this.edited.rings[ring], index));
      const h = this.edited.hidden[ring] || [];
      this.edited.hidden[ring] = h.flatMap(i => i < index ? [i] : i === index ? [i, i + 1] : [i + 1]);
    },
    drop(ring, index, isVertex) {
      if (!isVertex || this.edited.rings[ring].length < 4) return;
      this.edited.rings[ring].splice(index, 1);
      this.edited.hidden[ring] = (this.edited.hidden[ring] || []).filter(i => i !== index).map(i => i > index ? i - 1 : i);
      this.send();
    },
    move(e) {
      this.look(e);
      this.cursor = this.place(e);
      const h = this.held;
      if (!h) return;
      const dx = e.clientX - h.x, dy = e.clientY - h.y;
      h.moved = h.moved || Math.hypot(dx, dy) > STILL;
      if (!h.moved) return;
      if (h.draws) { this.stroke(h, e); return; }
      if (h.inserts) { this.insert(h.vertex[0], h.vertex[1] - 1); h.inserts = false; }
      if (h.vertex) this.edited.rings[h.vertex[0]][h.vertex[1]] = this.clamped(this.place(e));
      else { this.left = h.left + dx; this.top = h.top + dy; this.touched = true; }
    },
    up(e) {
      const h = this.held, p = this.place(e);
      this.held = null;
      if (!h) return;
      if (h.vertex) { if (h.moved) this.send(); return; }
      if (h.draws && h.moved) { this.lifted(h, p); return; }
      if (h.moved || h.button !== 0) return;
      if (this.drafts) { this.corner(this.clamped(p), e.shiftKey); return; }
      if (this.mode === 'hide') { this.mark(p); return; }
      if (h.name) { this.$emit('choose', {key: +h.name.dataset.key}); return; }
      const q = this.near(p);
      if (q) this.$emit('pick', {x: q[0], y: q[1], again: e.shiftKey});
    },
    // With Shift, the edge that ends at the corner is hidden.
    corner(p, hidden) {
      const first = this.draft[0];
      if (this.draft.length > 2 && Math.hypot(first[0] - p[0], first[1] - p[1]) * this.zoom < NEAR) { this.close(hidden); return; }
      if (hidden && this.draft.length) this.covered.push(this.draft.length - 1);
      this.draft.push(p);
    },
    // With Shift, a drag draws: hidden edges along its path, from the last corner on.
    stroke(h, e) {
      if (h.from === undefined) { h.from = this.draft.length; this.trace(h, h.x, h.y); }
      const [x, y] = h.last;
      if (Math.hypot(e.clientX - x, e.clientY - y) >= STROKE) this.trace(h, e.clientX, e.clientY);
    },
    trace(h, x, y) {
      h.last = [x, y];
      if (this.draft.length) this.covered.push(this.draft.length - 1);
      this.draft.push(this.clamped(this.place({clientX: x, clientY: y})));
    },
    lifted(h, p) {
      const first = this.draft[0], isBack = Math.hypot(first[0] - p[0], first[1] - p[1]) * this.zoom < NEAR;
      if (this.draft.length > 2 && (isBack || (this.mode === 'cut' && h.from === 0))) this.close(true);
    },
    close(hidden) {
      const last = this.draft.length - 1;
      if (last > 0 && Math.hypot(this.draft[last][0] - this.draft[last - 1][0], this.draft[last][1] - this.draft[last - 1][1]) * this.zoom < 2) this.pop();
      if (this.draft.length < 3) return;
      this.$emit('polygon', {ring: this.draft, hidden: hidden === true ? [...this.covered, this.draft.length - 1] : this.covered});
      this.forget();
    },
    forget() { this.draft = []; this.covered = []; },
    pop() {
      this.draft.pop();
      this.covered = this.covered.filter(i => i < this.draft.length - 1);
    },
    mark(p) {
      if (!this.edited) return;
      let best = [Infinity];
      this.edited.rings.forEach((ring, r) => ring.forEach((a, i) => {
        const b = ring[(i + 1) % ring.length], d = [b[0] - a[0], b[1] - a[1]];
        const t = Math.min(Math.max(((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] ** 2 + d[1] ** 2 || 1), 0), 1);
        const off = Math.hypot(a[0] + t * d[0] - p[0], a[1] + t * d[1] - p[1]) * this.zoom;
        if (off < best[0]) best = [off, r, i];
      }));
      if (best[0] > 2 * NEAR) return;
      const held = this.edited.hidden[best[1]] || [];
      this.edited.hidden[best[1]] = held.includes(best[2]) ? held.filter(i => i !== best[2]) : [...held, best[2]];
      this.send();
    },
    send() { this.$emit('rings', {key: this.edited.key, rings: this.edited.rings, hidden: this.edited.hidden}); },
    key(e) {
      if (['INPUT', 'TEXTAREA'].includes(e.target.tagName)) return;
      if (e.key === 'Escape') this.forget();
      if (e.key === 'Enter') this.close(e.shiftKey);
      if (e.key === 'Backspace' && this.draft.length) { this.pop(); e.preventDefault(); }
      if (e.key === '0') this.reset();
    },
    leave() { this.glass = false; this.cursor = null; },
    look(e) {
      const p = this.place(e), canvas = this.$refs.loupe, img = this.$refs.img;
      this.glass = (this.drafts || this.inside(p)) && !(this.held && this.held.moved && !this.held.vertex && !this.held.draws);
      if (!this.loupe || !this.glass || !img.naturalWidth) return;
      const b = this.$refs.box.getBoundingClientRect();
      this.glassLeft = e.clientX - b.left > b.width - LOUPE - 40 && e.clientY - b.top < LOUPE + 40;
      const g = canvas.getContext('2d'), f = img.naturalWidth / this.width, side = LOUPE / (POWER * Math.max(this.zoom, 1 / f));
      g.imageSmoothingEnabled = false;
      g.fillStyle = '#10141a'; g.fillRect(0, 0, LOUPE, LOUPE);
      const part = [(p[0] + 0.5 - side / 2) * f, (p[1] + 0.5 - side / 2) * f, side * f, side * f, 0, 0, LOUPE, LOUPE];
      g.drawImage(img, ...part);
      const over = this.over && this.$refs.over;
      if (over && over.naturalWidth) {
        g.globalAlpha = this.opacity;
        g.drawImage(over, ...part);
        g.globalAlpha = 1;
      }
      g.strokeStyle = '#fff'; g.lineWidth = 1; g.beginPath();
      g.moveTo(LOUPE / 2, LOUPE / 2 - 14); g.lineTo(LOUPE / 2, LOUPE / 2 - 4); g.moveTo(LOUPE / 2, LOUPE / 2 + 4); g.lineTo(LOUPE / 2, LOUPE / 2 + 14);
      g.moveTo(LOUPE / 2 - 14, LOUPE / 2); g.lineTo(LOUPE / 2 - 4, LOUPE / 2); g.moveTo(LOUPE / 2 + 4, LOUPE / 2); g.lineTo(LOUPE / 2 + 14, LOUPE / 2);
      g.stroke();
      g.fillStyle = 'rgba(12,15,20,.78)'; g.fillRect(0, LOUPE - 20, LOUPE, 20);
      g.fillStyle = '#fff'; g.font = '11px ui-monospace,monospace'; g.fillText(p[0].toFixed(1) + ', ' + p[1].toFixed(1), 8, LOUPE - 6);
    },
    loaded() { this.fitted(); },
  },
};
