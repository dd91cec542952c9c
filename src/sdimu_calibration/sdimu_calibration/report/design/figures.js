// Draws figures when they come near the window, in the colours of the theme, and then the others one after the other
// while there is nothing else to do; those that are folded away wait.
(function () {
  var LARGE = 1.5, NEAR = '400px', CELL = 27, WIDE = 33.5, BAR = 80, NOTABLE = 3, queue = [], library = null;
  // Width of a digit below a map and what keeps labels apart; least height of the map of a first screen (px).
  var DIGIT = 8, APART = 8, LEAST = 225;
  // Wait of a browser that does not tell when it is idle, and longest one of others (ms).
  var PAUSE = 50, LONGEST = 1000;

  // The library lies in the page compressed: it is unpacked once, after the page is there.
  function load() {
    library = library || (async function () {
      var packed = atob(document.getElementById('library').textContent);
      var stream = new Blob([Uint8Array.from(packed, function (c) { return c.charCodeAt(0); })]).stream();
      var text = await new Response(stream.pipeThrough(new DecompressionStream('gzip'))).text();
      var script = document.createElement('script');
      script.textContent = text; document.head.appendChild(script);
    })();
    return library;
  }

  // Figures count in pixels: on a screen of 4K all that is written, and the room for it, is made larger.
  function enlarge(part, by) {
    Object.keys(part).forEach(function (key) {
      var value = part[key];
      if (!value || typeof value !== 'object' || key === 'template' || typeof value[0] === 'number') { return; }
      if (/font$|^marker$/.test(key) && typeof value.size === 'number') { value.size *= by; }
      enlarge(value, by);
    });
  }

  function content(place) {
    var theme = window.sdimuTheme(), colours = FIGURE_COLOURS[theme];
    var figure = JSON.parse(place.querySelector('script').textContent.replace(/"@(\w+)"/g, function (all, name) {
      return name in colours ? '"' + colours[name] + '"' : all;
    }));
    figure.layout.template = FIGURE_TEMPLATES[theme];
    if (place.dataset.show) {
      figure.data.forEach(function (trace, k) { trace.visible = k === Number(place.dataset.show); });
    }
    if (window.innerWidth >= 2400) {
      enlarge(figure, LARGE);
      // What states no size of its own has that of the template.
      figure.layout.font = Object.assign({size: LARGE * figure.layout.template.layout.font.size}, figure.layout.font);
      Object.keys(figure.layout.margin).forEach(function (side) { figure.layout.margin[side] *= LARGE; });
      figure.layout.height *= LARGE;
    }
    return figure;
  }

  // Numbers stand in the cells of a map where they fit, smaller in cells that are not WIDE (px); where they do not, the
  // sign of what stands out, and all on hover. A map of many stops comes with signs, which are no numbers: they stay.
  function fitNumbers(figure, width) {
    var room = width - figure.layout.margin.l - figure.layout.margin.r - BAR;
    figure.data.forEach(function (trace) {
      var cell = room / trace.x.length;
      if (trace.type !== 'heatmap' || !trace.texttemplate || !(cell < WIDE)) { return; }
      if (cell >= CELL) { trace.textfont.size *= cell / WIDE; return; }
      trace.text = trace.text.map(function (row) {
        return row.map(function (text) { return Math.abs(Number(text.replace('\u2212', '-'))) < NOTABLE ? '' : text.charAt(0); });
      });
    });
  }

  // Below a map of many stops every second or third number stands, upright, where all of them would touch.
  function fitLabels(figure, width) {
    var axis = figure.layout.xaxis, trace = figure.data[0];
    if (!trace || trace.type !== 'heatmap' || axis.type !== 'category') { return; }
    var longest = Math.max.apply(null, trace.x.map(function (x) { return String(x).length; }));
    if (longest > 3) { return; }
    var cell = (width - figure.layout.margin.l - figure.layout.margin.r - BAR) / trace.x.length;
    axis.tickangle = 0; axis.dtick = Math.max(1, Math.ceil((DIGIT * longest + APART) / cell));
  }

  // The map of a first screen gives way to the words above it, as far as its rows still hold a number.
  function fitHeight(place, box, height) {
    box.style.height = height + 'px';
    var card = place.closest('#verdict .card');
    if (!card) { return height; }
    var free = window.innerHeight - window.scrollY - card.getBoundingClientRect().bottom + height;
    if (free >= height || free < LEAST * (window.innerWidth >= 2400 ? LARGE : 1)) { return height; }
    box.style.height = Math.floor(free) + 'px';
    return Math.floor(free);
  }

  function draw(place) {
    var figure = content(place), box = place.firstElementChild, width = place.clientWidth;
    figure.layout.height = fitHeight(place, box, figure.layout.height);
    if (window.innerWidth >= 2400) { width /= LARGE; }
    fitNumbers(figure, width);
    fitLabels(figure, width);
    place.dataset.drawn = 'yes';
    Plotly.react(box, figure.data, figure.layout, FIGURE_CONFIG);
  }

  function next() {
    if (!queue.length) { return; }
    load().then(function () {
      var place = queue.shift();
      if (place && !place.dataset.drawn) { draw(place); }
      setTimeout(next, 0);
    });
  }

  // A capture of the whole page shows what was never near the window, too.
  function whenIdle(work) {
    if (window.requestIdleCallback) { window.requestIdleCallback(work, {timeout: LONGEST}); } else { setTimeout(work, PAUSE); }
  }
  function rest() {
    load().then(function () {
      var place = queue.length ? null : all().find(function (p) { return !p.dataset.drawn && !p.closest('details:not([open])'); });
      if (place) { draw(place); }
      if (place || queue.length) { whenIdle(rest); }
    });
  }

  // For tests and for printing by a program: draws everything, folded away or not.
  window.sdimuDrawAll = function () { return load().then(function () { all().forEach(draw); }); };
  function all() { return Array.from(document.querySelectorAll('.figure')); }
  document.addEventListener('DOMContentLoaded', function () {
    var begun = false, near = new IntersectionObserver(function (entries) {
      entries.forEach(function (entry) {
        if (!entry.isIntersecting) { return; }
        near.unobserve(entry.target);
        queue.push(entry.target);
        if (queue.length === 1) { next(); }
      });
      // The first call is of all figures: those near the window are in the queue now.
      if (!begun) { begun = true; whenIdle(rest); }
    }, {rootMargin: NEAR});
    all().forEach(function (place) { near.observe(place); });
    setTimeout(load, 0);
  });
  document.addEventListener('click', function (event) {
    var button = event.target.closest && event.target.closest('.switched button[data-show]');
    if (!button) { return; }
    button.parentNode.querySelectorAll('button').forEach(function (other) {
      other.setAttribute('aria-pressed', String(other === button));
    });
    var place = button.closest('.switched').querySelector('.figure');
    place.dataset.show = button.dataset.show;
    if (place.dataset.drawn) { draw(place); }
  });
  var later = 0, width = window.innerWidth;
  window.addEventListener('resize', function () {
    clearTimeout(later);
    later = setTimeout(function () {
      if (!window.Plotly || window.innerWidth === width) { return; }
      width = window.innerWidth;
      all().filter(function (p) { return p.dataset.drawn && p.querySelector('.heatmaplayer'); }).forEach(draw);
    }, 200);
  });
  window.addEventListener('sdimu-theme', function () {
    if (window.Plotly) { all().filter(function (p) { return p.dataset.drawn; }).forEach(draw); }
  });
  window.addEventListener('beforeprint', function () {
    if (!window.Plotly) { return; }
    var theme = window.sdimuTheme;
    window.sdimuTheme = function () { return 'light'; };
    all().forEach(draw);
    window.sdimuTheme = theme;
  });
  window.addEventListener('afterprint', function () {
    if (window.Plotly) { all().filter(function (p) { return p.dataset.drawn; }).forEach(draw); }
  });
})();
