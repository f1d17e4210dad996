"""Material of the corpus and of mutations: heads and shapes of SVG, batch files, words, odd numbers."""

WIDTH, HEIGHT = 32, 24
"""Size of the corpus' pictures [px]."""

HEAD = f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}">'

HEADS = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 24">',
    '<svg xmlns="http://www.w3.org/2000/svg" width="1in" height=".75in">',
    '<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY a "red">]><svg xmlns="http://www.w3.org/2000/svg" width="100%" viewBox="-5 -5 64 48">',
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="8em" height="6em" viewBox="0 0 32 24" preserveAspectRatio="none">',
    '<svg xmlns="http://www.w3.org/2000/svg" width="32" height="24" viewBox="0 0 3200 2400">',
)
"""Other ways to state the size of an SVG."""

SHAPES = (
    '<path d="M2 2C8 2 20 4 28 10S14 22 9 20z" fill="#8a3c1e" fill-opacity=".8"/>',
    '<path d="M3 12q8-9 12 0t12 2" fill="none" stroke="#123" stroke-width="2.5" stroke-linecap="round"/>',
    '<path d="M8 12q2-8 10-8t8 8-10 8-8-8" fill="#83c" fill-opacity=".7"/>',
    '<path d="M8 12Q10 4 18 4T26 12 16 20 8 12z" fill="#38c"/>',
    '<path d="M2 6q9-9 13 2t8 3t-4 6 6 5" fill="none" stroke="#a52" stroke-width="1.5" stroke-linecap="round" stroke-linejoin="round"/>',
    '<path d="M4 4h20v14H4zM8 8v6h10V8z" fill="teal" fill-rule="evenodd"/>',
    '<path d="M5 20A9 7 30 1 0 20 5" style="fill:none;stroke:rgb(10%,20%,30%);stroke-opacity:.5"/>',
    '<rect x="1" y="2" width="12" height="9" rx="3" fill="hsl(120,50%,50%)"/>',
    '<circle cx="20" cy="10" r="6" fill="#0f08" opacity="50%"/>',
    '<ellipse cx="16" cy="12" rx="9" ry="4" transform="rotate(20 16 12) skewX(5)"/>',
    '<polygon points="1,1 30,3 16,22" fill="orange"/>',
    '<polyline points="2 20 9 4 17 19 30 2" fill="none" stroke="navy" stroke-dasharray="3 1 2" stroke-linejoin="bevel"/>',
    '<line x1="0" y1="0" x2="32" y2="24" stroke="black" stroke-linecap="square" stroke-miterlimit="2"/>',
    '<g transform="matrix(.9 .1 -.1 .9 1 2)" opacity=".7"><path d="M0 0L9 9 0 9z"/><rect width="5" height="5" fill="red"/></g>',
    '<g style="mix-blend-mode:multiply;isolation:isolate"><rect width="20" height="20" fill="cyan"/></g>',
    '<defs><linearGradient id="g"><stop offset="0" stop-color="red"/><stop offset="1" stop-color="blue" stop-opacity=".5"/>'
    '</linearGradient></defs><rect width="32" height="24" fill="url(#g)"/>',
    '<defs><radialGradient id="r" cx=".3" fx=".1" gradientTransform="scale(2)"><stop stop-color="lime"/></radialGradient></defs>'
    '<circle cx="9" cy="9" r="8" fill="url(#r)"/>',
    '<defs><pattern id="p" width="4" height="4" patternUnits="userSpaceOnUse"><rect width="2" height="2"/></pattern></defs>'
    '<rect width="32" height="24" fill="url(#p)"/>',
    '<defs><clipPath id="c"><circle cx="9" cy="9" r="8"/></clipPath></defs><rect width="32" height="24" clip-path="url(#c)"/>',
    '<defs><mask id="m"><rect width="9" height="9" fill="white"/></mask></defs><rect width="32" height="24" mask="url(#m)"/>',
    '<defs><filter id="f"><feGaussianBlur stdDeviation="2"/><feTurbulence baseFrequency=".1" numOctaves="2"/></filter></defs>'
    '<rect width="32" height="24" filter="url(#f)"/>',
    '<symbol id="s" viewBox="0 0 9 9"><rect width="9" height="9"/></symbol><use href="#s" x="3" y="3" width="9" height="9"/>',
    '<switch><g systemLanguage="xx"><rect width="9" height="9" fill="red"/></g><g><rect width="9" height="9"/></g></switch>',
    '<style>.a{fill:#345;stroke:none} path{opacity:.9}</style><path class="a" d="M1 1l20 3-5 16z"/>',
    '<text x="3" y="12" font-size="9">Aé</text>',
    '<marker id="k" markerWidth="3" markerHeight="3"><path d="M0 0L3 3"/></marker><path d="M2 2L20 20" stroke="red" marker-end="url(#k)"/>',
    '<image width="9" height="9" href="data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="/>',
    '<svg x="3" y="3" width="9" height="9" viewBox="0 0 3 3" preserveAspectRatio="xMaxYMin slice"><rect width="3" height="3"/></svg>',
)  # fmt: skip
"""One feature of SVG each."""

SVG_WORDS = (
    "path", "g", "svg", "rect", "circle", "ellipse", "line", "polygon", "polyline", "use", "symbol", "switch", "defs", "style",
    "text", "tspan", "image", "mask", "clipPath", "filter", "pattern", "marker", "linearGradient", "stop", "a", "script",
    "d", "fill", "stroke", "opacity", "fill-opacity", "stroke-opacity", "stroke-width", "transform", "viewBox", "width", "height",
    "x", "y", "r", "rx", "cx", "points", "href", "id", "class", "display", "visibility", "fill-rule", "stroke-dasharray",
    "stroke-linecap", "stroke-linejoin", "preserveAspectRatio", "none", "inherit", "currentColor", "evenodd", "hidden", "auto",
    "scale", "rotate", "translate", "matrix", "skewX", "url", "rgb", "rgba", "hsl", "white", "transparent", "em", "ex", "px",
    "M", "m", "L", "l", "H", "v", "C", "c", "S", "Q", "T", "q", "t", "A", "a", "Z", "z", "xMidYMid", "meet", "slice",
    *SHAPES,
    "<!-- " + "<path " * 3000 + "-->",
    "<!--" + "fill:" + " " * 5000 + "-->",
    '<path style="fill:' + " " * 5000 + '"/>',
    "<![CDATA[<path d='M0 0'/>]]>",
    '<path d="z"/>',
    '<path d="M0 0' + "l1 1" * 3000 + '"/>',
    '<path d="M0 0q1 2 3 1' + "t1 1" * 3000 + '"/>',
    '<path d="M0 0' + "a9 9 0 1 1 1 1" * 300 + '"/>',
    '<path d="' + "M0 0z" * 2000 + '"/>',
    '<use href="#s"/>',
    '<g id="s"><use href="#s"/></g>',
    "&a;",
    '<g transform="scale(1e30)">',
    '<g transform="scale(1e-30) rotate(45)">',
    '<circle r="1e9" fill="url(#g)"/>',
    ' width="0"', ' height="-1"', ' width="1e30"', ' height="2000000"', ' width="100%"', ' viewBox="0 0 0 0"',
    ' viewBox="0 0 1 60000"', ' viewBox="0 0 3200 2400"', ' viewBox="0 0 3200000 2400000"', ' viewBox="1e30 0 1e-30 5"', ' viewBox="nan 0 1 1"', ' style="mix-blend-mode:screen"',
    ' stroke-dasharray="1e-9"', ' stroke-dasharray="0 0"', ' stroke-miterlimit="0"', ' stroke-width="1e30"', ' opacity=".5em"',
    ' fill="url(#nothing) red"', ' fill="#ggg"', ' fill="rgb(999,-1,1e400)"', ' transform="matrix(0 0 0 0 0 0)"', ' d=""',
    "\0", "\x1b[31m", "\ufffe", "\u202e", "</g>", "</svg>", "<svg>", "<", ">", '"', "&", "&#0;", "&#x110000;",
)  # fmt: skip

YAMLS = (
    "jobs:\n  - images: in/a.png\n",
    "defaults:\n  curves: 3\n  quality: draft\n  output: out\njobs:\n  - images: in/*.png\n  - images: [in/b.jpg, 'in/**/c.*']\n"
    "    curves: 4\n    closed: true\n",
    "defaults: {curves: 3, iterations: 1, seed: 7, device: cpu, precision: 2, renderer: exact}\n"
    "jobs: [{images: in/a.png, output: out, time-budget: 2s, max-bytes: 10KB, target-psnr: 30.5}]\n",
    "# comment\ndefaults: &d\n  open: true\n  output: 'out/deep'\njobs:\n- images:\n  - in/a.png\n  - \"in/\\u00e9.png\"\n  iterations: 2\n",
    "presets:\n  fine: {curves: 3, rates: {points: 1}}\ndefaults: {iterations: 1, device: cpu}\njobs:\n  - images: in\n    preset: fine\n"
    "    matrix: {seed: [1, 2], quality: [draft, high]}\n    output: 'out/{quality}/{stem}-{seed}.svg'\n",
    "defaults: {curves: 4, iterations: 2, paint: auto, background: none, max-memory: 2GB, title: t}\n"
    "jobs:\n  - {images: in/a.png, levels: '1,4', output: out}\n  - {images: in/b.jpg, colors: 3, subject: drawing}\n"
    "  - {images: in/deep/c.gif, palette: '#f00,#00f', layered: false, opaque: true, size: 50x40mm, ids: true, minify: true}\n",
    "%YAML 1.2\n---\njobs:\n  - images: !!str in/a.png\n    output: >-\n      folded\n      name\n    quality: high\n...\n",
)

YAML_WORDS = (
    "defaults", "jobs", "images", "curves", "quality", "iterations", "seed", "precision", "renderer", "target-psnr",
    "time-budget", "max-bytes", "closed", "open", "output", "device", "draft", "balanced", "high", "exact", "splat", "true", "false", "null", "yes", "~",
    "cpu", "cuda", "in", "a.png", "b.jpg", "out", "60s", "10GB", "1e3", "presets", "preset", "matrix", "rates", "{stem}", "{folder}", "{curves}",
    "paint", "linear", "radial", "layered", "levels", "colors", "palette", "opaque", "max-memory", "background", "none", "title", "size", "page",
    "units", "ids", "minify", "mixed", "subject", "photo", "drawing", "line", "pixel", "importance", "rates", "density", "2GB", "a4", "1,4",
    "[" * 2000, "{" * 2000, "[" * 50 + "]" * 50, "- " * 500, "? " * 300, "&x ", "*x", "*d", "<<: *d\n", "!!python/object:os.system ", "!!binary a", "!!int x ",
    "!!float .nan ", "!!timestamp 2001-99-99 ", '"\\U00110000"', '"\\ud800"', '"a\\0b"', "'in/a\x00.png'", "in/" + "x" * 300, "../" * 40, "~nobody/", "~/",
    "in/[", "**", "***", "?", "\t", "\r", "\u2028", "\ufeff", "\x07", "  ", "\n", "\n---\n", "\n...\n", "%TAG ! x\n", "|\n", ">2\n", "# ", ": ", "- ", ", ",
    "jobs:\n", "  - images: in/a.png\n", "    output: loop/x\n", "    output: in/a.png\n", "    output: fifo\n", "    images: fifo\n", "    images: .\n",
    "{", "}", "{{", "{}", "{x}", "'{stem}/../..'", "    matrix: {curves: [1, 2]}\n", "    preset: x\n", ".inf", "-.inf", ".nan", "0o777", "0x7f", "1_000", "190:20:30", "9" * 5000, "1e999",
)  # fmt: skip


NUMBERS = ("0", "-0", "1", "-1", "0.5", "1e-9", "1e9", "1e30", "-1e30", "3.5e38", "1e308", "-1e309", "1e-320", "nan", "inf",
           "NaN", "Infinity", "9" * 400, "0." + "0" * 300 + "1", "2147483648", "-2147483649", "65536", "1e", "--1", "+.5e+2",
           "0x10", "1_000", "١٢", "1,5", "", "50%", "-50%", "1e400%", "2em", "3ex", "1in", "5rem", "10vw", "1q", "90deg")  # fmt: skip
"""Replacements for numbers."""


FITS = (
    ("--closed",), ("--open",), ("--mixed",), ("--paint", "auto"), ("--paint", "linear"), ("--paint", "radial", "--background", "none"),
    ("--layered",), ("--levels", "2,4"), ("--levels", "1,4", "--paint", "auto"), ("--colors", "3"), ("--palette", "#f00,#0f0,#00f"),
    ("--opaque",), ("--background", "none"), ("--background", "#204060"), ("--renderer", "splat"), ("--renderer", "gaussian"),
    ("--subject", "photo"), ("--subject", "drawing"), ("--subject", "line"), ("--subject", "pixel"), ("--subject", "drawing", "--colors", "2"),
    ("--max-memory", "300MB"), ("--max-memory", "310MB", "--json"), ("--max-memory", "1MB"), ("--max-memory", "100GB"), ("--json",),
    ("--ids",), ("--minify", "--title", "<&>"), ("--size", "50x40mm"), ("--max-bytes", "700"), ("--target-psnr", "14"),
)  # fmt: skip
"""Options of ``vectorize``."""


PAINTS = ("red", "#123", "#4080c0", "rgb(10%,50%,90%)", "hsl(90,50%,50%)", "teal")

CLAIMS_OF_FILLS = (
    "", "", "", 'fill-opacity="0"', 'fill-opacity=".5"', 'fill-opacity="80%"', 'fill-rule="evenodd"', 'style="mix-blend-mode:multiply"',
    'opacity=".6"', 'display="none"', 'visibility="hidden"', 'transform="rotate(20 16 12)"', 'transform="scale(.5 -1) translate(3 -9)"',
    'style="fill:lime"', 'clip-path="url(#none)"',
)  # fmt: skip
"""Attributes of filled shapes."""

CLAIMS_OF_STROKES = (
    "", 'stroke-linecap="round" stroke-linejoin="round"', 'stroke-linecap="round" stroke-linejoin="round" stroke-width="3"',
    'stroke-linecap="round" stroke-linejoin="round" stroke-opacity=".5"', 'stroke-linecap="square"', 'stroke-linejoin="bevel"',
    'stroke-dasharray="3 2"', 'stroke-miterlimit="1"', 'stroke-width="3"', 'stroke-width="10%"',
    'style="stroke-linecap:round;stroke-linejoin:round" transform="scale(2 1)"', 'vector-effect="non-scaling-stroke" transform="scale(2)"',
)  # fmt: skip
"""Attributes of stroked shapes."""

GROUPS = (
    "<g>", "<g>", "<g>", '<g opacity=".5">', '<g transform="translate(2 1)">', '<g stroke-linecap="round" stroke-linejoin="round">',
    "<symbol>", "<switch>", "<defs>", "<a>", '<g fill="none">', '<g style="isolation:isolate">',
)  # fmt: skip
"""Start tags around shapes."""
