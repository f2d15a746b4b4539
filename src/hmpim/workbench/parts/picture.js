// A described picture drawn by Plotly, with cursors that can be dragged and a server that refills
// curves on zoom. Arrays come as base64 of their bytes and become typed arrays, never lists.
const KINDS = { f4: Float32Array, f8: Float64Array, i4: Int32Array };
const DARK = {
  "#1f2328": "#e6edf3", "#111827": "#f0f3f6", "#5b636b": "#a5b0bb", "#d5d9de": "#3a434d",
  "#0072b2": "#56b4e9", "#d55e00": "#ff9d5c", "#b0417f": "#e58ac0", "#009e73": "#3ecfa3",
  "rgba(255,255,255,0.8)": "rgba(27,33,40,0.8)",
};

export function unpacked(value) {
  if (Array.isArray(value)) return value.map(unpacked);
  if (value === null || typeof value !== "object") return value;
  if (value.bdata !== undefined) {
    const text = atob(value.bdata);
    const bytes = new Uint8Array(text.length); // a plain loop: ten times as quick as a function each
    for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
    const flat = new KINDS[value.dtype](bytes.buffer);
    if (!value.shape || value.shape.length < 2) return flat;
    const [rows, columns] = value.shape;
    return Array.from({ length: rows }, (_, r) => flat.subarray(r * columns, (r + 1) * columns));
  }
  return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, unpacked(v)]));
}

function recoloured(value) {
  if (typeof value === "string") return DARK[value.toLowerCase()] ?? value;
  if (Array.isArray(value)) return value.map(recoloured);
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value)) return value;
  return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, recoloured(v)]));
}

// How much larger than at a desk letters are on this screen: plots grow with the page.
function size() {
  return Math.max(1, parseFloat(getComputedStyle(document.documentElement).fontSize) / 16);
}

const PAPER = matchMedia("print");

// About as wide as letters are on average, as a share of their size.
const LETTER = 0.52;

// Words in so many pixels, in lines of about equal length.
function wrapped(words, room, letters) {
  const lines = Math.ceil((words.length * LETTER * letters) / Math.max(room, letters));
  if (lines < 2 || !words.includes(" ")) return words;
  const most = words.length / lines;
  const out = [""];
  for (const word of words.split(" ")) {
    const last = out[out.length - 1];
    if (last && last.length + word.length / 2 > most && out.length < lines) out.push(word);
    else out[out.length - 1] = last ? `${last} ${word}` : word;
  }
  return out.join("<br>");
}

// Where a value stands in its panel, as a share of the axis.
function share(axis, value) {
  const [low, high] = axis.range;
  return (value - low) / (high - low);
}

// Ticks at values of their own keep apart from each other by so many pixels.
function thinned(axis, room, apart) {
  if (axis.tickmode !== "array") return;
  let last = -Infinity;
  const kept = [...axis.tickvals.keys()].filter((k) => {
    const at = room * share(axis, axis.tickvals[k]);
    if (at - last < apart) return false;
    last = at;
    return true;
  });
  axis.tickvals = kept.map((k) => axis.tickvals[k]);
  axis.ticktext = kept.map((k) => axis.ticktext[k]);
}

// Fits the words of a layout into a picture of this width: names of axes are wrapped, and the words
// on a line stay inside the panel.
function fitted(layout, width, letters) {
  const across = width - layout.margin.l - layout.margin.r;
  const down = layout.height - layout.margin.t - layout.margin.b;
  for (const [key, axis] of Object.entries(layout)) {
    if (!/^[xy]axis\d*$/.test(key)) continue;
    const [first, last] = axis.domain ?? [0, 1];
    const room = (key[0] === "x" ? across : down) * (last - first);
    if (axis.title) {
      axis.title = { ...axis.title, text: wrapped(axis.title.text, room, 1.15 * letters) };
    }
    if (key[0] === "x") thinned(axis, room, 2.5 * letters);
  }
  for (const note of layout.annotations ?? []) {
    const axis = /^x\d*$/.test(note.xref) && layout[note.xref.replace("x", "xaxis")];
    if (!axis || note.xanchor === "center") continue;
    const [first, last] = axis.domain ?? [0, 1];
    const room = across * (last - first);
    const wide = 1.1 * LETTER * letters * note.text.length;
    const at = room * share(axis, note.x);
    const beyond = note.xanchor === "left" ? Math.max(0, at + wide - room) : Math.min(0, at - wide);
    if (beyond) note.xshift = (note.xshift ?? 0) - beyond;
  }
}

// Pictures of a page are drawn one after the other, and the page answers between two of them.
let turn = Promise.resolve();

function inTurn(draw) {
  const drawn = turn.then(() => new Promise((done) => setTimeout(done, 0))).then(draw);
  turn = drawn.catch(() => {}); // one that fails is said on the page, and the next is drawn
  return drawn;
}

// What two drawings must have in common for one to take the other's curves: all but the curves'
// points and the ends of the axes.
function likeness(data, layout) {
  if (data.some((t) => t.type !== "scatter" || t.error_y)) return "";
  const axes = /^[xy]axis\d*$/;
  const bare = Object.entries({ ...layout, meta: 0 })
    .map(([k, v]) => [k, axes.test(k) ? { ...v, range: 0 } : v]);
  return JSON.stringify([bare, data.map((t) => ({ ...t, x: 0, y: 0 }))]);
}

function ends(layout) {
  const axes = Object.entries(layout).filter(([k]) => /^[xy]axis\d*$/.test(k));
  return Object.fromEntries(axes.map(([k, v]) => [k, v.range]));
}

const AT_ONCE = {
  mode: "immediate", transition: { duration: 0 }, frame: { duration: 0, redraw: false },
};

function near(a, b) {
  return a.every((v, k) => Math.abs(v - b[k]) < 1e-9 * (Math.abs(v) + 1e-9));
}

// Whether curves that want these ends are seen well between those shown.
function holds(shown, wanted) {
  const [low, high] = shown;
  const span = high - low;
  return (
    wanted[0] >= low - 0.02 * span && wanted[1] <= high + 0.02 * span &&
    wanted[1] - wanted[0] > 0.7 * span
  );
}

export default {
  template: '<div class="hm-picture" role="figure" :aria-label="alt"></div>',
  props: { figure: Object, cursors: Array, alt: String },
  async mounted() {
    this.current ??= { figure: this.figure, cursors: this.cursors };
    this.drawn = 0;
    const { Plotly } = await import("nicegui-plotly");
    this.Plotly = Plotly;
    await inTurn(() => this.$el.isConnected && this.update());
    if (!this.drawn) return; // it was taken away meanwhile
    this.sizes = new ResizeObserver(() => this.resized());
    this.sizes.observe(this.$el);
    PAPER.addEventListener("change", this.update);
    this.theme = new MutationObserver(() => {
      const dark = document.body.classList.contains("body--dark");
      if (dark !== this.dark) this.update(); // other classes come and go while one scrolls or types
    });
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
  },
  unmounted() {
    this.sizes?.disconnect();
    this.theme?.disconnect();
    PAPER.removeEventListener("change", this.update);
    clearTimeout(this.fitting);
    clearTimeout(this.resizing);
    this.Plotly?.purge(this.$el);
  },
  methods: {
    // Draws another figure. Of several that come while one is drawn only the last counts. Points of
    // a curve that are as they were are not sent again, nor is the frame.
    show(figure, alt, cursors) {
      const before = (this.current ?? this).figure;
      const data = figure.data.map((t, k) => ({
        ...t, ...Object.fromEntries(t.kept.map((key) => [key, before.data[k][key]])),
      }));
      this.current = { figure: { data, layout: figure.layout ?? before.layout }, cursors };
      this.$el.setAttribute("aria-label", alt);
      if (!this.drawn || this.waiting) return; // it is drawn with all else that comes first
      this.waiting = setTimeout(() => this.update(), 0);
    },
    // Another width asks for another drawing; on paper there is no time for more than that.
    resized() {
      if (!this.drawn || !this.$el.clientWidth || this.$el.clientWidth === this.width) return;
      clearTimeout(this.resizing);
      if (PAPER.matches) this.update();
      else this.resizing = setTimeout(() => this.update(), 100);
    },
    async update() {
      clearTimeout(this.waiting);
      this.waiting = 0;
      if (!this.Plotly) return;
      this.dark = document.body.classList.contains("body--dark");
      const dark = this.dark && !PAPER.matches;
      const { figure, cursors } = this.current;
      const plain = { data: unpacked(figure.data), layout: unpacked(figure.layout) };
      const { data, layout } = dark ? recoloured(plain) : plain;
      const grown = (this.grown = size());
      layout.font = {
        ...(layout.font ?? {}), color: dark ? "#e6edf3" : "#1f2328", size: 12 * grown,
      };
      layout.height *= grown;
      layout.margin = Object.fromEntries(
        Object.entries(layout.margin ?? {}).map(([side, room]) => [side, room * grown]),
      );
      this.width = layout.width = this.$el.clientWidth;
      const narrow = this.width < 600;
      if (narrow) {
        layout.margin = { ...layout.margin, l: 48, r: 6 };
        layout.font.size = 11;
        layout.legend = { ...layout.legend, font: { size: 11 } };
      }
      fitted(layout, this.width, layout.font.size);
      const panels = layout.height - layout.margin.t - layout.margin.b;
      if ((cursors ?? []).some((c) => c.panel === "")) { // their names stand above the first panel
        layout.legend.y = 1 + (1.5 * layout.font.size) / panels;
        layout.height += 1.5 * layout.font.size;
        layout.margin.t += 1.5 * layout.font.size;
      }
      this.fixed = (layout.shapes ?? []).length;
      layout.shapes = [...(layout.shapes ?? []), ...(cursors ?? []).map((c) => this.shape(c, layout))];
      const like = likeness(data, layout);
      if (this.drawn && like && like === this.like) await this.move(data, layout);
      else {
        await this.redraw(data, layout, cursors);
        // what stands around the panels has taken some of their room: it is given back
        const lost = panels - this.$el._fullLayout._size.h;
        // a legend stays where it was when it stood higher, until the height is set anew
        if (lost > 2 || this.drawn) {
          await this.Plotly.relayout(this.$el, { height: layout.height + Math.max(lost, 0.5) });
        }
        this.ends = ends(layout);
      }
      this.like = like;
      this.drawn += 1;
      this.$el.dataset.drawn = this.drawn;
    },
    async redraw(data, layout, cursors) {
      // shapes are dragged at once with this alone; "editable" only makes them ask for a click first
      const edits = { shapePosition: (cursors ?? []).length > 0 };
      const config = {
        displaylogo: false, responsive: false, scrollZoom: false, edits,
        modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
      };
      await this.Plotly.react(this.$el, data, layout, config);
      for (const path of this.$el.querySelectorAll(".shapelayer path[data-index]")) {
        if (Number(path.dataset.index) < this.fixed) path.style.pointerEvents = "none";
      }
      // what is done by dragging is no use to keys, and a page of plots has many
      for (const drag of this.$el.querySelectorAll(".modebar-btn[data-attr=dragmode]")) {
        drag.tabIndex = -1;
      }
      if (!this.drawn) this.$el.on("plotly_relayout", this.moved);
    },
    // Moves curves; nothing else is drawn anew. The ends of an axis that nobody has zoomed follow at
    // once where a curve would leave it or shrink in it, else once the curves rest: an axis takes
    // longer to draw than all curves.
    async move(data, layout) {
      clearTimeout(this.fitting);
      const frame = { data: data.map(({ x, y }) => ({ x, y })), traces: [...data.keys()], layout: {} };
      let fits = true;
      for (const [axis, range] of Object.entries(ends(layout))) {
        const shown = this.$el.layout[axis].range;
        if (!near(shown, this.ends[axis]) || near(shown, range)) continue; // zoomed, or as it was
        if (holds(shown, range)) fits = false;
        else frame.layout[axis] = { range };
        this.ends[axis] = holds(shown, range) ? shown : range;
      }
      await this.Plotly.animate(this.$el, frame, AT_ONCE);
      if (!fits) this.fitting = setTimeout(() => this.fit(layout), 300);
    },
    fit(layout) {
      const fitted = {};
      for (const [axis, range] of Object.entries(ends(layout))) {
        const shown = this.$el.layout[axis].range;
        if (!near(shown, this.ends[axis]) || near(shown, range)) continue;
        fitted[axis] = { range };
        this.ends[axis] = range;
      }
      this.Plotly.animate(this.$el, { data: [], traces: [], layout: fitted }, AT_ONCE);
    },
    shape(c, layout) {
      const axis = layout[`xaxis${c.panel}`];
      const at = axis.type === "log" ? Math.log10(c.at) : c.at;
      const across = c.axis === "y";
      const along = { [across ? "y0" : "x0"]: c.at, [across ? "y1" : "x1"]: c.at };
      const ends = across ? { x0: 0, x1: 1 } : { y0: 0, y1: 1 };
      return {
        type: "line", ...along, ...ends, name: c.name,
        xref: across ? `x${c.panel} domain` : `x${c.panel}`,
        yref: across ? `y${c.panel}` : `y${c.panel} domain`,
        line: { color: c.colour ?? "#b0417f", width: 4, dash: "solid" },
        label: { // above the panel, to the side where there is room
          text: c.label, textposition: "end", yanchor: "bottom", textangle: 0, padding: 2,
          xanchor: share(axis, at) < 0.5 ? "left" : "right", font: { size: layout.font.size },
        },
      };
    },
    moved(event) {
      const zoomed = {};
      for (const [key, value] of Object.entries(event)) {
        const dragged = key.match(/^shapes\[(\d+)\]\.(x0|y0)$/);
        if (dragged && Number(dragged[1]) >= this.fixed) {
          const cursor = this.current.cursors[Number(dragged[1]) - this.fixed];
          const own = cursor.axis === "y" ? "y0" : "x0";
          if (own === dragged[2]) this.$emit("cursor", { name: cursor.name, at: Number(value) });
        }
        const range = key.match(/^xaxis(\d*)\.range\[([01])\]$/);
        if (range) (zoomed[range[1]] ??= [null, null])[Number(range[2])] = Number(value);
        const whole = key.match(/^xaxis(\d*)\.autorange$/);
        if (whole) zoomed[whole[1]] = [null, null];
      }
      const [first] = Object.entries(zoomed);
      if (first) this.$emit("zoom", { panel: first[0], low: first[1][0], high: first[1][1] });
    },
    refill(curves) {
      if (!this.drawn) return;
      const { figure } = this.current;
      const data = figure.data.map((t) => ({ ...t }));
      for (const { index, x, y } of curves) Object.assign(data[index], { x, y });
      this.current = { ...this.current, figure: { ...figure, data } };
      const numbers = curves.map((c) => c.index);
      const x = curves.map((c) => unpacked(c.x));
      const y = curves.map((c) => unpacked(c.y));
      this.Plotly.restyle(this.$el, { x, y }, numbers);
      this.$el.dataset.refilled = Number(this.$el.dataset.refilled ?? 0) + 1;
    },
  },
};
