// Keys, the list of keys, and what a click on a row or a card does.
(function () {
  function at(id) { return document.getElementById(id); }
  function press(id) { var button = at(id); if (button && !button.disabled) { button.click(); } }
  function set(id, props) { window.dash_clientside.set_props(id, props); }

  // Components of Dash lack names, and some hide elements that a keyboard still reaches: said and mended here.
  var NAMES = {shows: 'What is shown', which: 'Which stops', candidate: 'Candidate', channel: 'Channel', against: 'Against', added: 'Added effect', held: 'Stops left out', recording: 'Recording', coefficient: 'Coefficient'};
  function mend() {
    document.querySelectorAll('.dash-radioitems').forEach(function (list) { list.setAttribute('role', 'radiogroup'); });
    document.querySelectorAll('.dash-radioitems label').forEach(function (label) { label.removeAttribute('role'); label.removeAttribute('aria-selected'); });
    document.querySelectorAll('#upload input').forEach(function (input) { input.setAttribute('aria-label', 'Effect file'); input.tabIndex = -1; });
    Object.keys(NAMES).forEach(function (id) { if (at(id)) { at(id).setAttribute('aria-label', NAMES[id]); } });
  }
  new MutationObserver(mend).observe(document.documentElement, {childList: true, subtree: true});

  function candidate(by) {
    var figure = document.querySelector('#ranking .js-plotly-plot');
    if (!figure || !figure.data.length) { return; }
    var names = Array.from(figure.data[0].y, function (name) { return String(name).replace(/^\u25B6 /, ''); });
    var now = names.indexOf(at('candidate-name') ? at('candidate-name').dataset.name : '');
    set('candidate', {value: names[Math.max(0, Math.min(names.length - 1, now + by))]});
  }
  function show(by) {
    var inputs = Array.from(document.querySelectorAll('#shows input'));
    var now = inputs.findIndex(function (input) { return input.checked; });
    inputs[(now + by + inputs.length) % inputs.length].click();
  }
  var KEYS = {
    a: function () { press('add'); }, j: function () { candidate(1); }, k: function () { candidate(-1); },
    x: function () { press('leave-points'); }, i: function () { press('take-points'); }, s: function () { press('toggle-stop'); },
    b: function () { show(1); }, u: function () { press('undo'); }, r: function () { press('redo'); }, e: function () { press('export'); },
    '?': function () { var help = at('help'); help.hidden = !help.hidden; if (!help.hidden) { help.focus(); } }, c: function () { drawer(at('drawer').hidden); },
    Escape: function () { at('help').hidden = true; drawer(false); }
  };
  document.addEventListener('keydown', function (event) {
    var key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    var writes = /^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName) && event.target.type !== 'radio' || event.target.isContentEditable;
    if (writes || event.altKey) { return; }
    if (event.ctrlKey || event.metaKey) {
      if (key === 'z') { event.preventDefault(); press(event.shiftKey ? 'redo' : 'undo'); }
      if (key === 'y') { event.preventDefault(); press('redo'); }
      return;
    }
    if (KEYS[key]) { event.preventDefault(); KEYS[key](); }
  });
  // The drawer of coefficients: the row that is chosen opens, and the controls of its prior stand in it.
  var edited = null;
  function place() {
    var rows = document.querySelector('.drawer .rows'), editor = at('editor'), here = rows && rows.querySelector('tr.here');
    if (!rows) { return; }
    editor.hidden = !here;
    if (!here) { return; }
    rows.style.setProperty('--editor', editor.offsetHeight + 'px');
    editor.style.top = here.getBoundingClientRect().bottom - rows.getBoundingClientRect().top - editor.offsetHeight - 2 + 'px';
  }
  window.benchEdit = function (name) {
    edited = name || null;
    // The table of this answer is drawn after it.
    setTimeout(function () {
      document.querySelectorAll('tr[data-coefficient]').forEach(function (row) { row.classList.toggle('here', row.dataset.coefficient === edited); });
      place();
    }, 0);
    return edited;
  };
  function drawer(open) {
    at('drawer').hidden = !open;
    at('coefficients-open').setAttribute('aria-expanded', open);
    if (open) { place(); at('drawer').focus(); }
  }
  window.addEventListener('resize', place);
  document.addEventListener('click', function (event) {
    var row = event.target.closest && event.target.closest('tr[data-coefficient]');
    if (!row) { return; }
    set('coefficient', {value: row.dataset.coefficient});
    setTimeout(function () { if (at('mean')) { at('mean').focus({preventScroll: true}); } }, 50);
  });
  document.addEventListener('keydown', function (event) {
    if (event.key === 'Enter' && /^(mean|sigma)$/.test(event.target.id)) { event.preventDefault(); press('set-prior'); }
    if (event.key === 'Escape' && event.target.closest && event.target.closest('.drawer')) { drawer(false); }
  });

  // What the server does is said on the card that asked for it, too.
  var asked = null;
  document.addEventListener('click', function (event) {
    asked = event.target.closest ? event.target.closest('.card') || asked : asked;
  }, true);
  function working() {
    var busy = at('busy'), words = busy && !busy.hidden ? busy.textContent.trim() : '';
    document.querySelectorAll('.card[data-working]').forEach(function (card) {
      if (card !== asked || !words) { delete card.dataset.working; }
    });
    if (asked && words && asked.dataset.working !== words) { asked.dataset.working = words; }
    if (!words && asked && !asked.isConnected) { asked = null; }
  }
  setInterval(working, 200);

  document.addEventListener('click', function (event) {
    if (event.target.id === 'help-open') { KEYS['?'](); }
    if (event.target.id === 'help-close') { at('help').hidden = true; }
    if (event.target.id === 'coefficients-open') { KEYS.c(); }
    if (event.target.id === 'coefficients-close') { drawer(false); at('coefficients-open').focus(); }
  });
})();
