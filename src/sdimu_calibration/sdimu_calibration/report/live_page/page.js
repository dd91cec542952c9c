// The candidate that was clicked.
(function () {
  function at(id) { return document.getElementById(id); }
  function set(id, props) { window.dash_clientside.set_props(id, props); }

  // A component of Dash lacks a name.
  function mend() {
    if (at('candidate')) { at('candidate').setAttribute('aria-label', 'Effect to add'); }
  }
  new MutationObserver(mend).observe(document.documentElement, {childList: true, subtree: true});

  document.addEventListener('click', function (event) {
    var row = event.target.closest && event.target.closest('tr[data-candidate]');
    if (!row) { return; }
    set('candidate', {value: row.dataset.candidate});
    document.querySelectorAll('tr[data-candidate]').forEach(function (other) { other.classList.toggle('here', other === row); });
  });
})();
