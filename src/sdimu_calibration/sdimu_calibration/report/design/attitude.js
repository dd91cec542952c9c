// The IMU in space at a stop that a slider chooses: its axes, gravity, the Earth's rate. Drag to look from elsewhere.
document.querySelectorAll('.attitude').forEach(function (place) {
  var data = JSON.parse(place.querySelector('script').textContent), svg = place.querySelector('svg');
  var slider = place.querySelector('input'), told = place.querySelector('output');
  // What stands still reaches further than the axes: at a stop along north, east or down, words would lie on words.
  var view = {turn: -0.6, lift: 0.45}, NS = 'http://www.w3.org/2000/svg', STILL = 1.15, REACH = 1.35;

  function seen(p) { // North, East, Down to the sheet: right, up, depth
    var e = p[1], n = p[0], u = -p[2], c = Math.cos(view.turn), s = Math.sin(view.turn);
    var right = e * c + n * s, away = n * c - e * s, cl = Math.cos(view.lift), sl = Math.sin(view.lift);
    return [right, u * cl + away * sl, away * cl - u * sl];
  }
  function add(kind, attributes, text) {
    var made = document.createElementNS(NS, kind);
    Object.keys(attributes).forEach(function (key) { made.setAttribute(key, attributes[key]); });
    if (text) { made.textContent = text; }
    svg.appendChild(made);
  }
  function at(p) { var q = seen(p); return [100 + 62 * q[0], 100 - 62 * q[1]]; }
  function arrow(p, ink, word, dash) {
    var end = at(p), far = at(p.map(function (v) { return 1.16 * v; }));
    add('line', {x1: 100, y1: 100, x2: end[0], y2: end[1], stroke: 'var(--' + ink + ')', 'stroke-width': 2.2,
                 'stroke-dasharray': dash || '', 'marker-end': 'url(#head)'});
    add('text', {x: far[0], y: far[1], fill: 'var(--' + ink + ')'}, word);
  }
  function polygon(points, style) { add('polygon', Object.assign({points: points.map(at).join(' ')}, style)); }
  function scaled(C, v) { // body to North, East, Down
    return [0, 1, 2].map(function (i) { return C[3 * i] * v[0] + C[3 * i + 1] * v[1] + C[3 * i + 2] * v[2]; });
  }
  function draw() {
    var k = Number(slider.value), C = data.C[k], ring = [], j;
    while (svg.lastChild && svg.lastChild.nodeName !== 'defs') { svg.removeChild(svg.lastChild); }
    for (j = 0; j < 40; j += 1) { ring.push([Math.cos(j * Math.PI / 20), Math.sin(j * Math.PI / 20), 0]); }
    polygon(ring, {fill: 'var(--sunken)', stroke: 'var(--line)'});
    [['N', [REACH, 0, 0]], ['E', [0, REACH, 0]]].forEach(function (mark) {
      var p = at(mark[1]); add('text', {x: p[0], y: p[1], fill: 'var(--muted)'}, data.arbitrary ? '' : mark[0]);
    });
    var faces = [];
    [[0, 1, 2], [1, 2, 0], [2, 0, 1]].forEach(function (axes) {
      [-1, 1].forEach(function (side) {
        var corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(function (c) {
          var v = [0, 0, 0]; v[axes[0]] = 0.3 * side; v[axes[1]] = 0.3 * c[0]; v[axes[2]] = 0.3 * c[1];
          return scaled(C, v);
        });
        var depth = corners.reduce(function (sum, c) { return sum + seen(c)[2]; }, 0);
        faces.push([depth, corners]);
      });
    });
    faces.sort(function (a, b) { return b[0] - a[0]; }).forEach(function (face) {
      polygon(face[1], {fill: 'var(--card)', 'fill-opacity': 0.8, stroke: 'var(--muted)'});
    });
    arrow([0, 0, STILL], 'muted', 'g', '5 3');
    if (data.latitude !== null) {
      arrow([STILL * Math.cos(data.latitude), 0, -STILL * Math.sin(data.latitude)], 'doubtful', '\u03a9', '2 3');
    }
    ['x', 'y', 'z'].forEach(function (axis, i) {
      arrow(scaled(C, [0, 1, 2].map(function (n) { return n === i ? 0.9 : 0; })), axis, axis);
    });
    told.textContent = data.words[k];
  }
  var from = null;
  svg.addEventListener('pointerdown', function (event) { from = [event.clientX, event.clientY]; svg.setPointerCapture(event.pointerId); });
  svg.addEventListener('pointermove', function (event) {
    if (!from) { return; }
    view.turn += 0.01 * (event.clientX - from[0]);
    view.lift = Math.max(-1.5, Math.min(1.5, view.lift + 0.01 * (event.clientY - from[1])));
    from = [event.clientX, event.clientY]; draw();
  });
  svg.addEventListener('pointerup', function () { from = null; });
  slider.addEventListener('input', draw);
  draw();
});
