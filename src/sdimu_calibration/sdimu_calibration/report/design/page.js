// Behaviour of every page: light or dark, copying, contents that follow, everything unfolded on paper.
(function () {
  var root = document.documentElement, dark = window.matchMedia('(prefers-color-scheme: dark)');
  window.sdimuTheme = function () { return root.dataset.theme || (dark.matches ? 'dark' : 'light'); };
  function tell() {
    document.querySelectorAll('[data-switch-theme]').forEach(function (b) {
      // The button says what a click on it does.
      b.textContent = window.sdimuTheme() === 'dark' ? 'Light page' : 'Dark page';
    });
    window.dispatchEvent(new Event('sdimu-theme'));
  }
  dark.addEventListener('change', tell);
  // Listens on the document, so that a button which is made later works too.
  document.addEventListener('click', function (event) {
    if (!event.target.closest || !event.target.closest('[data-switch-theme]')) { return; }
    root.dataset.theme = window.sdimuTheme() === 'dark' ? 'light' : 'dark';
    try { localStorage.setItem('sdimu-theme', root.dataset.theme); } catch (e) { /* private pages keep nothing */ }
    tell();
  });
  document.addEventListener('DOMContentLoaded', tell);

  document.addEventListener('click', function (event) {
    var button = event.target.closest && event.target.closest('button[data-copy]');
    if (!button) { return; }
    var source = document.getElementById(button.dataset.copy), word = button.textContent;
    function done() { button.textContent = 'Copied'; setTimeout(function () { button.textContent = word; }, 1500); }
    function byHand() {
      source.hidden = false; source.select(); document.execCommand('copy'); source.hidden = true; done();
    }
    if (navigator.clipboard) { navigator.clipboard.writeText(source.value).then(done, byHand); } else { byHand(); }
  });

  document.addEventListener('DOMContentLoaded', function () {
    var links = document.querySelectorAll('.contents a[href^="#"]');
    if (!links.length) { return; }
    var seen = new IntersectionObserver(function (entries) {
      entries.forEach(function (entry) {
        if (!entry.isIntersecting) { return; }
        links.forEach(function (link) {
          if (link.hash === '#' + entry.target.id) { link.setAttribute('aria-current', 'true'); }
          else { link.removeAttribute('aria-current'); }
        });
      });
    }, {rootMargin: '-15% 0px -75% 0px'});
    links.forEach(function (link) {
      var place = document.getElementById(link.hash.slice(1));
      if (place) { seen.observe(place); }
    });
  });

  var folded = [];
  window.addEventListener('beforeprint', function () {
    folded = Array.from(document.querySelectorAll('details:not([open])'));
    folded.forEach(function (d) { d.open = true; });
  });
  window.addEventListener('afterprint', function () { folded.forEach(function (d) { d.open = false; }); });
})();
