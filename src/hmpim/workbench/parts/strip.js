// A strip of command and response of one axis, drawn by uPlot.
const PAPER = matchMedia("print");
let loading;

function library() {
  loading ??= new Promise((done, failed) => {
    const base = `${window.path_prefix ?? ""}/static/uplot/`;
    const style = Object.assign(document.createElement("link"), {
      rel: "stylesheet", href: `${base}uPlot.min.css`,
    });
    const script = Object.assign(document.createElement("script"), {
      src: `${base}uPlot.iife.min.js`, onload: () => done(window.uPlot), onerror: failed,
    });
    document.head.append(style, script);
  });
  return loading;
}

function floats(text) {
  return new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
}

export default {
  template: '<div class="hm-strip" role="figure" :aria-label="label"></div>',
  props: { label: String, unit: String, names: Array, limit: Number, span: Number },
  async mounted() {
    await new Promise((done) => setTimeout(done, 0)); // until the page knows its own address
    this.uPlot = await library();
    this.build();
    if (this.early) this.show(...this.early);
    this.sizes = new ResizeObserver(() => this.plot?.setSize(this.size()));
    this.sizes.observe(this.$el);
    this.theme = new MutationObserver(this.inked); // light, dark and paper have inks of their own
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    PAPER.addEventListener("change", this.inked);
  },
  unmounted() {
    this.sizes?.disconnect();
    this.theme?.disconnect();
    PAPER.removeEventListener("change", this.inked);
    this.plot?.destroy();
  },
  methods: {
    inked() {
      const ink = getComputedStyle(this.$el).color;
      if (ink !== this.ink) this.plot?.redraw(false, true);
      this.ink = ink;
    },
    size() {
      return { width: Math.max(this.$el.clientWidth, 100), height: 150 * this.grown() };
    },
    grown() {
      return Math.max(1, parseFloat(getComputedStyle(document.documentElement).fontSize) / 16);
    },
    build() {
      const ink = () => getComputedStyle(this.$el).color;
      const grown = this.grown();
      const font = `${12 * grown}px system-ui, sans-serif`;
      const axis = { stroke: ink, font, labelFont: `bold ${font}`, size: 50 * grown, grid: { stroke: "rgba(128,128,128,0.25)", width: 1 } };
      const line = (label, stroke, dash) => ({ label, stroke, dash, width: 1.5, spanGaps: true });
      const limits = this.limit
        ? [line(`limits ±${this.limit} ${this.unit}`, "#b0417f", [6, 4]), line("", "#b0417f", [6, 4])]
        : [];
      this.plot = new this.uPlot(
        {
          ...this.size(), title: "", legend: { live: false }, cursor: { show: false },
          scales: { x: { time: false } },
          axes: [axis, { ...axis, space: 18 * grown, size: 64 * grown, label: this.unit, labelSize: 16 * grown }],
          series: [{}, line(this.names[0], "#0072b2"), line(this.names[1], "#d55e00"), ...limits],
        },
        [[0], [null], [null], ...limits.map(() => [null])],
        this.$el,
      );
    },
    show(end, command, response) {
      if (!this.plot) {
        this.early = [end, command, response]; // the library still comes
        return;
      }
      const tables = [command, response]
        .map((pair) => pair.map(floats))
        .map(([x, y]) => (x.length ? [x, y] : [new Float32Array([end]), [null]]));
      const begin = Math.max(0, end - this.span);
      if (this.limit) {
        const ends = [begin, Math.max(end, begin + 0.01)];
        tables.push([ends, [this.limit, this.limit]], [ends, [-this.limit, -this.limit]]);
      }
      this.plot.setData(this.uPlot.join(tables), false);
      this.plot.setScale("x", { min: begin, max: Math.max(end, begin + 0.01) });
      let top = 0;
      for (const [, y] of tables.slice(0, 2)) for (const v of y) top = Math.max(top, Math.abs(v));
      const near = this.limit && top > 0.3 * this.limit;
      top = 1.1 * (near ? Math.max(top, this.limit) : top || 1);
      this.plot.setScale("y", { min: -top, max: top });
      this.$el.dataset.end = end;
      this.$emit("shown"); // the next one may come: a slow browser is not flooded
    },
  },
};
