// Theme, whether the command still answers, and the candidate that was clicked.
(function () {
  var ALIVE_MS = 2000, SLOW_MS = 20000, missed = 0, lost = false;
  function at(id) { return document.getElementById(id); }
  function set(id, props) { window.dash_clientside.set_props(id, props); }
  function ended() { return at('ended') && at('ended').classList.contains('ended'); }

  function ask() {
    // Once the test has ended its command ends, too, and the page needs nothing more.
    if (ended()) { return; }
    var stop = new AbortController(), timer = setTimeout(function () { stop.abort(); }, SLOW_MS);
    fetch('alive', {cache: 'no-store', signal: stop.signal}).then(function (answer) {
      if (!answer.ok) { throw new Error(answer.status); }
      missed = 0;
      if (lost) { location.reload(); }
    }).catch(function () {
      missed += 1;
      if (missed >= 2 && !lost && !ended()) { lost = true; at('lost').hidden = false; }
    }).finally(function () { clearTimeout(timer); setTimeout(ask, ALIVE_MS); });
  }
  setTimeout(ask, ALIVE_MS);

  // A component of Dash lacks a name, and hides an element that a keyboard still reaches.
  function mend() {
    // The button comes after the page has told its theme.
    document.querySelectorAll('[data-switch-theme]').forEach(function (b) {
      var words = window.sdimuTheme() === 'dark' ? 'Light page' : 'Dark page';
      if (b.textContent !== words) { b.textContent = words; }
    });
    document.querySelectorAll('.dash-dropdown-focus-target').forEach(function (input) { input.tabIndex = -1; });
    if (at('candidate')) { at('candidate').setAttribute('aria-label', 'Effect to add'); }
  }
  new MutationObserver(mend).observe(document.documentElement, {childList: true, subtree: true});

  document.addEventListener('click', function (event) {
    var row = event.target.closest && event.target.closest('tr[data-candidate]');
    if (!row) { return; }
    set('candidate', {value: row.dataset.candidate});
    document.querySelectorAll('tr[data-candidate]').forEach(function (other) { other.classList.toggle('here', other === row); });
  });
  window.addEventListener('sdimu-theme', function () { if (at('sigmas')) { set('look', {data: window.benchLook()}); } });
  window.benchLook = function () {
    return {scale: window.innerWidth >= 2400 ? 1.6 : 1, theme: window.sdimuTheme ? window.sdimuTheme() : 'light'};
  };
})();
