"""SVGs that others might have drawn."""

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" '


SMALL = HEAD + 'width="40" height="30">'
PATH = '<path d="M10 10H70V40Z"/>'
ROUND = 'fill="none" stroke="red" stroke-linecap="round" stroke-linejoin="round"'
FOREIGN = {
    "lines": 'width="40" height="30"><path d="M5 5H35V25L5 20Z" fill="#f00"/></svg>',
    "hole": 'width="40" height="30"><path d="M2 2H38V28H2ZM10 8V20H30V8Z" fill="blue"/></svg>',
    "transform": 'width="40" height="30"><g transform="translate(4,2) scale(2)">'
    '<path d="M0 0l10 0q4 5 0 10z" style="fill:#0a0;fill-opacity:.5"/></g></svg>',
    "shapes": 'viewBox="0 0 80 60"><rect width="80" height="60" fill="#ddd"/>'
    '<circle cx="30" cy="30" r="20" fill="rgb(200,10,60)"/><ellipse cx="60" cy="20" rx="9" ry="5"/></svg>',
    "arc": 'width="40" height="30"><path d="M10 15A8 8 0 0 1 26 15zM3 3h5v5h-5" fill="#123456"/></svg>',
    "strokes": 'width="40" height="30"><path d="M3 5C10 30 20-10 37 20" fill="none" stroke="#808" '
    'stroke-width="4" stroke-linecap="round" stroke-linejoin="round"/></svg>',
    "css": 'width="40" height="30"><style>/* . */.a{fill:red;opacity:.5}#b,path{fill:#0a0}</style>'
    '<g opacity=".6"><path class="a" d="M2 2h30v20z"/></g>'
    '<path id="b" style="fill:hsl(200,50%,50%)" d="M9 9h9v9z"/></svg>',
    "place": 'width="80" height="60" viewBox="10 0 20 30" preserveAspectRatio="xMinYMax">'
    '<circle cx="50%" cy="1e1" r="9"/></svg>',
    "even-odd": 'width="40" height="30">'
    '<path fill-rule="evenodd" d="M2 2h30v20h-30zM5 5v9h9v-9z" fill="#d40"/></svg>',
    "unseen": 'width="40" height="30"><defs><g id="x"><use href="#x"/></g></defs>'
    '<symbol><path d="M0 0h40v30z"/></symbol>'
    '<g display="none"><text/></g><path visibility="hidden" d="M0 0h40v9z"/><path d="M9 3h9v9z"/></svg>',
    "closed stroke": 'width="40" height="30"><path d="M6 6h20v15zm15 15v-5" fill="none" stroke="#a3c" '
    'stroke-width="3" stroke-linejoin="round" stroke-linecap="round"/></svg>',
    "none": 'width="40" height="30"><path d="M0 0H9V9Z" fill="none"/><path d="M9 9H30V20Z"/></svg>',
}
