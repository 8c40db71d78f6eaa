// SPDX-License-Identifier: GPL-3.0-or-later
// The studies' tables: sorted by any column, filtered by every one.

function compareValues(a, b) {
  if (a === b) return 0;
  if (a === null || a === undefined) return 1;
  if (b === null || b === undefined) return -1;
  const x = Number(a), y = Number(b);
  if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
  return String(a).localeCompare(String(b), 'en', {numeric: true});
}

// A test of numbers from "< 0.1", ">= 3", "0.1 .. 0.2" or "5"; null where the text is none of them.
function numberTest(text) {
  const number = '([-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:e[-+]?\\d+)?)';
  const range = new RegExp(`^\\s*${number}\\s*\\.\\.\\s*${number}\\s*$`, 'i').exec(text);
  if (range) return (v) => v >= Number(range[1]) && v <= Number(range[2]);
  const bound = new RegExp(`^\\s*(<=|>=|<|>|=)?\\s*${number}\\s*$`, 'i').exec(text);
  if (!bound) return null;
  const wanted = Number(bound[2]);
  switch (bound[1]) {
    case '<': return (v) => v < wanted;
    case '<=': return (v) => v <= wanted;
    case '>': return (v) => v > wanted;
    case '>=': return (v) => v >= wanted;
    default: return (v) => formatNumber(v) === formatNumber(wanted);
  }
}

class StudyTable {
  constructor(study, index) {
    this.study = study;
    this.index = index;
    this.sort = null;  // {column, down}
    this.tests = new Map();  // column -> test of a value
    this.search = '';
    this.shown = new Set(study.columns.map((column, i) => i).filter((i) => study.columns[i].main));
    this.chosen = null;
    const axes = study.columns.map((column, i) => i)
      .filter((i) => study.columns[i].kind === 'axis');
    this.rows = study.rows.slice().sort((a, b) => {
      for (const i of axes) {
        const order = compareValues(a.values[i], b.values[i]);
        if (order) return order;
      }
      return a.id < b.id ? -1 : 1;
    });
    const resolved = (column) => study.columns.findIndex(
      (other) => other.name === column.name.replace(/^error\./, 'error.resolved.'));
    this.resolved = study.columns.map((column) =>
      column.name.startsWith('error.') ? resolved(column) : -1);
  }

  build() {
    this.count = element('span', {class: 'quiet row-count', 'aria-live': 'polite'});
    this.head = element('thead');
    this.body = element('tbody');
    this.detail = element('div', {'aria-live': 'polite'});
    this.node = element('div', {class: 'study', id: `study-${this.index}`}, this.provenance(),
                        this.failures(), this.controls(),
                        element('div', {class: 'scroll', tabindex: '0',
                                        'aria-label': `results of ${this.study.name}`},
                                element('table', {}, this.head, this.body)),
                        this.detail);
    this.drawHead();
    this.drawRows();
    return this.node;
  }

  provenance() {
    const list = element('dl', {class: 'facts provenance'});
    for (const [name, value] of this.study.provenance)
      list.append(element('dt', {}, name.replace('_', ' ')), element('dd', {}, value));
    return list;
  }

  failures() {
    const failures = this.study.failures;
    if (failures.length === 0) return null;
    return element('div', {class: 'notice failures', role: 'note'},
                   failures.length === 1 ? '1 cell has no result:'
                                         : `${failures.length} cells have no result:`,
                   element('ul', {}, ...failures.map(
                     (f) => element('li', {}, element('code', {}, f.id), ' ', f.error))));
  }

  controls() {
    const search = element('input', {type: 'search', id: `search-${this.index}`,
                                     placeholder: 'in all axes',
                                     oninput: () => {
                                       this.search = search.value.toLowerCase();
                                       this.drawRows();
                                     }});
    return element('div', {class: 'controls'},
                   element('label', {for: search.id}, 'Search', search), this.columnPicker(),
                   element('button', {type: 'button', class: 'reset', onclick: () => this.reset()},
                           'Reset'),
                   element('button', {type: 'button', onclick: () => this.saveCsv()},
                           'Save rows as CSV'),
                   this.count);
  }

  columnPicker() {
    const list = element('div', {class: 'list'});
    this.study.columns.forEach((column, i) => {
      list.append(checkbox(column.label, `column-${this.index}-${i}`, this.shown.has(i), (on) => {
        if (on) this.shown.add(i);
        else this.shown.delete(i), this.tests.delete(i);
        this.drawHead();
        this.drawRows();
      }));
    });
    const details = element('details', {class: 'columns'}, element('summary', {}, 'Columns'), list);
    details.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape') return;
      details.open = false;
      details.firstChild.focus();
    });
    document.addEventListener('pointerdown', (event) => {
      if (!details.contains(event.target)) details.open = false;
    });
    return details;
  }

  reset() {
    this.sort = null;
    this.tests.clear();
    this.search = '';
    this.node.querySelector('input[type="search"]').value = '';
    this.drawHead();
    this.drawRows();
  }

  columns() { return [...this.shown].sort((a, b) => a - b); }

  drawHead() {
    const titles = element('tr'), filters = element('tr', {class: 'filters'});
    for (const i of this.columns()) {
      titles.append(this.headCell(i));
      filters.append(element('th', {}, this.filterOf(i)));
    }
    titles.append(element('th', {}, 'run'));
    filters.append(element('th'));
    this.head.replaceChildren(titles, filters);
  }

  headCell(i) {
    const column = this.study.columns[i], sorted = this.sort && this.sort.column === i;
    const arrow = sorted ? (this.sort.down ? '\u25bc' : '\u25b2') : '';
    const button = element(
      'button', {type: 'button', class: 'sort', 'data-column': column.name,
                 title: [column.about, 'press to sort'].filter(Boolean).join('; ')},
      column.label, ' ', column.unit ? element('span', {class: 'unit'}, `[${column.unit}]`) : '',
      element('span', {class: 'arrow', 'aria-hidden': 'true'}, arrow));
    button.addEventListener('click', () => {
      this.sort = {column: i, down: Boolean(sorted && !this.sort.down)};
      this.drawHead();
      this.drawRows();
      this.head.querySelector(`[data-column="${CSS.escape(column.name)}"]`).focus();
    });
    const order = sorted ? (this.sort.down ? 'descending' : 'ascending') : 'none';
    return element('th', {class: column.kind === 'number' ? 'number' : '', scope: 'col',
                          'aria-sort': order}, button);
  }

  filterOf(i) {
    const column = this.study.columns[i];
    return column.kind === 'axis' ? this.axisFilter(i, column) : this.numberFilter(i, column);
  }

  axisFilter(i, column) {
    const values = [...new Set(this.rows.map((row) => row.values[i]))].sort(compareValues);
    const select = element('select', {'aria-label': `only this ${column.label}`,
                                      'data-filter': column.name},
                           element('option', {value: ''}, 'all'),
                           ...values.map((value, k) => element('option', {value: k + 1},
                                                               value === null ? '\u2013' : value)));
    if (this.tests.has(i)) select.value = this.tests.get(i).text;
    select.addEventListener('change', () => {
      if (select.value === '') this.tests.delete(i);
      else this.tests.set(i, {text: select.value,
                              test: (v) => v === values[Number(select.value) - 1]});
      this.drawRows();
    });
    return select;
  }

  numberFilter(i, column) {
    const input = element('input', {type: 'text', placeholder: '< 0.1', 'data-filter': column.name,
                                    'aria-label': `${column.label}: < 0.1, >= 2 or 1 .. 3`,
                                    title: '< 0.1, >= 2, 5 or 1 .. 3'});
    if (this.tests.has(i)) input.value = this.tests.get(i).text;
    input.addEventListener('input', () => {
      const test = numberTest(input.value), empty = input.value.trim() === '';
      input.setAttribute('aria-invalid', String(!test && !empty));
      if (test) this.tests.set(i, {text: input.value, test: (v) => v !== null && test(Number(v))});
      else this.tests.delete(i);
      this.drawRows();
    });
    return input;
  }

  visibleRows() {
    const isAxis = (column) => column.kind === 'axis';
    const rows = this.rows.filter((row) => {
      for (const [i, {test}] of this.tests) if (!test(row.values[i])) return false;
      if (this.search === '') return true;
      return row.id.includes(this.search) || this.study.columns.some(
        (column, i) => isAxis(column) && String(row.values[i]).toLowerCase().includes(this.search));
    });
    if (!this.sort) return rows;
    const {column, down} = this.sort;
    return rows.sort((a, b) => {
      const x = a.values[column], y = b.values[column];
      if (x === null || y === null) return compareValues(x, y);  // nothing comes last, always
      return down ? compareValues(y, x) : compareValues(x, y);
    });
  }

  drawRows() {
    const rows = this.visibleRows(), columns = this.columns();
    this.body.replaceChildren(...rows.map((row) => this.rowOf(row, columns)));
    this.count.textContent = `${rows.length} of ${this.rows.length} rows`;
  }

  rowOf(row, columns) {
    const line = element('tr', {'data-id': row.id, class: row.id === this.chosen ? 'chosen' : ''});
    for (const i of columns) {
      const value = row.values[i], column = this.study.columns[i];
      if (column.kind === 'axis') {
        line.append(element('td', {}, value === null ? '\u2013' : value));
        continue;
      }
      const noise = this.resolved[i] >= 0 && row.values[this.resolved[i]] === false;
      line.append(element('td', {class: noise ? 'number unresolved' : 'number',
                                 title: noise ? `${value}; below 4 times its noise floor`
                                              : String(value)}, formatNumber(value)));
    }
    line.append(element('td', {}, element(
      'button', {type: 'button', title: `what was run for ${row.id}`,
                 'aria-label': `what was run for ${row.id}`,
                 onclick: () => this.choose(row)}, '\u2026')));
    return line;
  }

  choose(row) {
    this.chosen = this.chosen === row.id ? null : row.id;
    for (const line of this.body.children)
      line.classList.toggle('chosen', line.dataset.id === this.chosen);
    this.detail.replaceChildren();
    if (!this.chosen) return;
    this.detail.append(element('h3', {}, `Cell ${row.id}`),
                       element('pre', {}, row.command || 'no command line is recorded'));
  }

  saveCsv() {
    const quote = (value) => {
      const text = value === null || value === undefined ? '' : String(value);
      return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
    };
    const columns = this.columns();
    const lines = [['id', ...columns.map((i) => this.study.columns[i].name)],
                   ...this.visibleRows().map(
                     (row) => [row.id, ...columns.map((i) => row.values[i])])];
    saveText(`${this.study.name}.csv`, 'text/csv',
             lines.map((line) => line.map(quote).join(',') + '\n').join(''));
  }
}

function buildStudies() {
  if (report.studies.length === 0) return;
  const node = section('studies', 'Studies'), place = element('div');
  const tables = report.studies.map((study, i) => new StudyTable(study, i));
  const show = (i) => place.replaceChildren(element('h3', {}, report.studies[i].name),
                                            tables[i].node || tables[i].build());
  if (tables.length > 1)
    node.append(choiceButtons('study', report.studies.map((study, i) => [i, study.name]), 0, show));
  node.append(place, element('p', {class: 'quiet'},
    'Press a heading to sort. Filters: a value of an axis; for numbers < 0.1, >= 2, 5 or 1 .. 3. ' +
    'Numbers in italics are below four times the noise floor of the reference. The last button ' +
    'of a row shows the command that gave it.'));
  show(0);
}
