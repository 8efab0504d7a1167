"""How report.html looks and what moves in it; nothing is fetched."""

CSS = """
:root { --ink: #22272e; --soft: #68707c; --line: #e3e6ea; --wash: #f7f8fa; --accent: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: white;
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 1160px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 18px; margin: 40px 0 12px; }
.lead, figcaption, .note { color: var(--soft); } .note { font-size: 13px; }
code { font: 13px ui-monospace, "DejaVu Sans Mono", monospace; background: var(--wash); padding: 1px 5px;
  border-radius: 4px; overflow-wrap: anywhere; }
ul.words { list-style: none; padding: 0; margin: 12px 0; }
ul.words li { margin: 6px 0; padding: 7px 14px; border-left: 4px solid var(--line); background: var(--wash);
  border-radius: 0 6px 6px 0; overflow-wrap: anywhere; }
ul.words li.finding { border-color: var(--accent); } ul.words li.verdict { border-color: #009e73; }
ul.words li.alarm { border-color: #c62828; background: #fdf1f0; }
ul.words li.warning { border-color: #e69f00; background: #fff9ec; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: 13px;
  line-height: 1.4; }
th, td { padding: 6px 8px; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top;
  font-variant-numeric: tabular-nums; }
th { color: var(--soft); font-weight: 600; } th:first-child, td:first-child { text-align: left; }
td small { display: block; color: var(--soft); }
table.left th, table.left td { text-align: left; }
.plots { display: flex; flex-wrap: wrap; gap: 16px; } .plots img { width: 100%; }
.plots figure { flex: 1 1 330px; max-width: 540px; }
.plots figure.wide { flex-basis: 100%; max-width: 900px; }
figure { margin: 0; } figcaption { font-size: 13px; margin-top: 2px; }
.pictures { display: flex; flex-wrap: wrap; gap: 14px; } .pictures figure { flex: 0 1 256px; }
.pictures img { width: 100%; min-width: 160px; image-rendering: pixelated; border-radius: 4px;
  display: block; }
.cards figure { display: flex; flex-direction: column; gap: 6px; }
.cards figcaption { order: -1; margin: 0; font-size: 14px; line-height: 1.4; }
.cards strong { display: block; color: var(--ink); overflow-wrap: anywhere; }
.cards .key { flex: 1; display: flex; flex-direction: column; gap: 12px; font-size: 13px;
  color: var(--soft); }
img.shown { cursor: pointer; touch-action: none; -webkit-user-drag: none; user-select: none; }
.bar { height: 10px; width: 100%; max-width: 246px; border-radius: 5px; margin: 4px 0; }
.magma { background: linear-gradient(90deg, #000004, #51127c, #b73779, #fc8961, #fcfdbf); }
.signed { background: linear-gradient(90deg, #053061, #4393c3, #f7f7f7, #d6604d, #67001f); }
.ends { display: flex; justify-content: space-between; max-width: 246px; font-size: 12px;
  color: var(--soft); }
"""

SCRIPT = """
const truth = document.getElementById("reference");
for (const image of document.querySelectorAll("img.shown")) {
  const own = image.src;
  image.addEventListener("pointerdown", event => { event.preventDefault(); image.src = truth.src; });
  for (const end of ["pointerup", "pointerleave", "pointercancel"])
    image.addEventListener(end, () => { image.src = own; });
}
"""
"""A picture shows the reference in its place while it is pressed."""
