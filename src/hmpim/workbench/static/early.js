// The library that draws is fetched while a page with plots waits for what it will draw: reading it
// takes longer than any drawing.
if (/\/(design|run|analyse|runs)$/.test(location.pathname)) {
  addEventListener("load", () => setTimeout(() => import("nicegui-plotly").catch(() => {}), 200));
}
