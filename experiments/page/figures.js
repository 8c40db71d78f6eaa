// SPDX-License-Identifier: GPL-3.0-or-later
// The figures with their captions; one is as wide as its column or, pressed, as the page.

function buildFigures() {
  if (report.figures.length === 0) return;
  const node = section('figures', 'Figures'), grid = element('div', {class: 'figures'});
  report.figures.forEach((item) => {
    const image = element('img', {src: `data:${item.type};base64,${blobText(item.blob)}`,
                                  alt: item.caption || item.name});
    const button = element('button', {type: 'button', class: 'open', 'aria-pressed': 'false',
                                      title: 'wide or narrow'}, image);
    const figure = element('figure', {'data-name': item.name}, button,
                           element('figcaption', {}, element('strong', {}, item.name),
                                   item.caption ? '. ' + item.caption : ''));
    button.addEventListener('click', () => {
      button.setAttribute('aria-pressed', String(figure.classList.toggle('wide')));
    });
    grid.append(figure);
  });
  node.append(grid);
}
