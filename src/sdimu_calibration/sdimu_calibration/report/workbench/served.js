// What every served page does: watch whether its command still answers, follow the theme, mend components of Dash.
(function () {
  var ALIVE_MS = 2000, SLOW_MS = 20000, missed = 0, lost = false;
  function at(id) { return document.getElementById(id); }
  // Once a test has ended its command ends, too, and the page needs nothing more.
  function ended() { return at('ended') && at('ended').classList.contains('ended'); }

  // A server that is gone refuses at once; one that works hard answers late.
  function ask() {
    if (ended()) { return; }
    var stop = new AbortController(), timer = setTimeout(function () { stop.abort(); }, SLOW_MS);
    fetch('alive', {cache: 'no-store', signal: stop.signal}).then(function (answer) {
      if (!answer.ok) { throw new Error(answer.status); }
      missed = 0;
      // What was asked for when the server went is lost; the state is in the page, so that it can begin anew.
      if (lost) { location.reload(); }
    }).catch(function () {
      missed += 1;
      if (missed < 2 || lost || ended()) { return; }
      lost = true;
      at('lost').hidden = false;
      if (at('busy')) { at('busy').hidden = true; }
    }).finally(function () { clearTimeout(timer); setTimeout(ask, ALIVE_MS); });
  }
  setTimeout(ask, ALIVE_MS);

  function mend() {
    // The button comes after the page has told its theme.
    document.querySelectorAll('[data-switch-theme]').forEach(function (b) {
      var words = window.sdimuTheme() === 'dark' ? 'Light page' : 'Dark page';
      if (b.textContent !== words) { b.textContent = words; }
    });
    // A component of Dash hides an element that a keyboard still reaches.
    document.querySelectorAll('.dash-dropdown-focus-target').forEach(function (input) { input.tabIndex = -1; });
  }
  new MutationObserver(mend).observe(document.documentElement, {childList: true, subtree: true});

  // Width of a number in a cell of a heat map, and what stands beside the cells (px).
  var NUMBER = 27, MARGINS = 90;
  window.benchLook = function () {
    var scale = window.innerWidth >= 2400 ? 1.6 : 1, look = {scale: scale, theme: window.sdimuTheme ? window.sdimuTheme() : 'light'};
    var wide = at('heat') && at('heat').clientWidth;
    if (wide) { look.stops = Math.floor((wide / scale - MARGINS) / NUMBER); }
    return look;
  };
  // Figures are drawn by the command.
  var looks = '', later = null;
  function drawn() { return document.querySelector('.js-plotly-plot'); }
  function tell() { if (drawn()) { window.dash_clientside.set_props('look', {data: window.benchLook()}); } }
  window.addEventListener('sdimu-theme', tell);
  window.addEventListener('resize', function () {
    clearTimeout(later);
    later = setTimeout(function () {
      var now = JSON.stringify(window.benchLook());
      if (looks !== now) { looks = now; tell(); }
    }, 400);
  });
})();
