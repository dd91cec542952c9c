// Fits the figures of a page to the sheet while it is printed.
(function () {
  function figures() { return document.querySelectorAll('.js-plotly-plot'); }
  window.addEventListener('beforeprint', function () {
    figures().forEach(function (f) {
      // The sheet shows figures at 68 %, so that the tallest fits on a page; at less what a large screen has larger.
      var share = 0.68 * 13 / f._fullLayout.font.size;
      Plotly.relayout(f, {width: 680 / share, autosize: false});
      f.parentNode.style.height = share * f._fullLayout.height + 'px';
      f.querySelector('.plot-container').style.zoom = share;
    });
  });
  window.addEventListener('afterprint', function () {
    figures().forEach(function (f) {
      f.parentNode.style.height = '';
      f.querySelector('.plot-container').style.zoom = '';
      Plotly.relayout(f, {width: null, autosize: true});
    });
  });
})();
