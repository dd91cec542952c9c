"""Look and behaviour of the pages: one sheet, one plain script, nothing from elsewhere."""

from __future__ import annotations

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1180px; margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.5em; margin-bottom: 0; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15em .8em; text-align: right; border-bottom: 1px solid #e4e4e4; }
td { white-space: nowrap; } td.text:last-child { white-space: normal; min-width: 14em; }
th { border-bottom: 2px solid #222; } th.text, td.text { text-align: left; }
tr.first td { border-top: 1px solid #888; }
.quiet { color: #555; }
.verdict { border: 2px solid #222; border-left-width: 12px; padding: .6em 1em; font-size: 1.2em; margin: 1em 0; }
.verdict.good { border-color: #0b5394; } .verdict.bad { border-color: #b45f06; border-style: solid; }
.wide { overflow-x: auto; }
button { font: inherit; padding: .15em .9em; margin: .3em .5em .3em 0; cursor: pointer; }
summary { cursor: pointer; }
section { min-width: 0; }
@media (min-width: 2400px) {
  body { max-width: 3600px; font-size: 20px; }
  main { display: grid; grid-template-columns: 1fr 1fr; gap: 0 3em; align-items: start; }
}
@media print {
  @page { size: A4 portrait; margin: 12mm; }
  body { max-width: none; margin: 0; padding: 0; font-size: 11px; }
  main { display: block; }
  button, .modebar-container { display: none !important; }
  .wide { overflow: visible; } table { font-size: 9px; } th, td { padding: .1em .5em; }
  :has(> [id^="figure-"]), tr, .quiet, .verdict { break-inside: avoid; } p { break-inside: avoid; }
  h2, h2 + p, h2 + p + p, summary { break-after: avoid; }
  p.quiet { break-before: avoid; }
  .verdict, [id^="figure-"] { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""

SCRIPT = """
document.querySelectorAll('button[data-copy]').forEach(function (button) {
  button.addEventListener('click', function () {
    var source = document.getElementById(button.dataset.copy), word = button.textContent;
    function done() { button.textContent = 'Copied'; setTimeout(function () { button.textContent = word; }, 1500); }
    function byHand() {
      source.hidden = false; source.select(); document.execCommand('copy'); source.hidden = true; done();
    }
    if (navigator.clipboard) { navigator.clipboard.writeText(source.value).then(done, byHand); } else { byHand(); }
  });
});
(function () {
  var folded = document.querySelectorAll('details:not([open])');
  window.addEventListener('beforeprint', function () { folded.forEach(function (d) { d.open = true; }); });
  window.addEventListener('afterprint', function () { folded.forEach(function (d) { d.open = false; }); });
})();
"""
