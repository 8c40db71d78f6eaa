// SPDX-License-Identifier: GPL-3.0-or-later
// What all parts of the page share: its data, elements, numbers, colours.
'use strict';

const report = JSON.parse(document.getElementById('report-data').textContent);

// element('a', {href: '#x', onclick: f}, 'text', otherElement). Text never becomes markup.
function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else if (name === 'class') node.className = value;
    else if (value === true) node.setAttribute(name, '');
    else if (value !== false && value !== null && value !== undefined)
      node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

function blobText(index) {
  return document.getElementById('blob-' + index).textContent;
}

function blobBytes(index) {
  const text = atob(blobText(index));
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function blobFloats(index) {
  return new Float32Array(blobBytes(index).buffer);
}

let halfTable = null;

function makeHalfTable() {
  const table = new Float32Array(65536);
  for (let bits = 0; bits < 65536; ++bits) {
    const exponent = (bits >> 10) & 31, mantissa = bits & 1023;
    let value;
    if (exponent === 31) value = mantissa ? NaN : Infinity;
    else if (exponent === 0) value = mantissa * 2 ** -24;
    else value = (1 + mantissa / 1024) * 2 ** (exponent - 15);
    table[bits] = bits & 0x8000 ? -value : value;
  }
  return table;
}

function blobHalves(index) {
  halfTable = halfTable || makeHalfTable();
  const halves = new Uint16Array(blobBytes(index).buffer);
  const values = new Float32Array(halves.length);
  for (let i = 0; i < halves.length; ++i) values[i] = halfTable[halves[i]];
  return values;
}

// Four significant digits.
function formatNumber(value) {
  if (value === null || value === undefined) return '\u2013';
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (!Number.isFinite(value)) return String(value);
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e7) return String(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(3);
  return String(Number(value.toPrecision(4)));
}

function formatBytes(bytes) {
  const units = ['bytes', 'KiB', 'MiB', 'GiB'];
  let unit = 0;
  while (bytes >= 1024 && unit < 3) bytes /= 1024, ++unit;
  return `${formatNumber(unit ? Number(bytes.toPrecision(3)) : bytes)} ${units[unit]}`;
}

function luminanceOf(pixels, i) {
  return 0.2126 * pixels[3 * i] + 0.7152 * pixels[3 * i + 1] + 0.0722 * pixels[3 * i + 2];
}

// The value below which the share of the values lies; sorts them.
function percentileOf(values, share) {
  if (values.length === 0) return 0;
  values.sort();
  return values[Math.min(values.length - 1, Math.floor(share * values.length))];
}

// sRGB colours, equally spaced: the ends are ColorBrewer's RdBu, and nine points of viridis.
const errorColors = [[5, 48, 97], [67, 147, 195], [255, 255, 255], [214, 96, 77], [103, 0, 31]];
const falseColors = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141],
                     [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];

// 256 colours between them, [3 i + channel].
function colorTable(colors) {
  const table = new Uint8ClampedArray(3 * 256);
  for (let i = 0; i < 256; ++i) {
    const position = i / 255 * (colors.length - 1);
    const below = Math.min(Math.floor(position), colors.length - 2), f = position - below;
    for (let c = 0; c < 3; ++c)
      table[3 * i + c] = (1 - f) * colors[below][c] + f * colors[below + 1][c];
  }
  return table;
}
const errorTable = colorTable(errorColors), falseTable = colorTable(falseColors);

// A bar of colours with what its ends and its middle mean.
function legendBar(table, low, middle, high) {
  const canvas = element('canvas', {class: 'legend', width: 256, height: 1, 'aria-hidden': 'true'});
  const context = canvas.getContext('2d'), image = context.createImageData(256, 1);
  for (let i = 0; i < 256; ++i) {
    for (let c = 0; c < 3; ++c) image.data[4 * i + c] = table[3 * i + c];
    image.data[4 * i + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  const ends = element('div', {class: 'ends'}, ...[low, middle, high].map(
    (text) => element('span', {}, text)));
  return element('div', {class: 'legendbox'}, canvas, ends);
}

// Buttons of which one is pressed. choices: [[value, label, title]].
function choiceButtons(label, choices, value, onChange) {
  const box = element('div', {class: 'group', role: 'group', 'aria-label': label});
  const press = (chosen) => {
    for (const button of box.children)
      button.setAttribute('aria-pressed', String(button.dataset.value === String(chosen)));
  };
  for (const [key, text, title] of choices)
    box.append(element('button', {type: 'button', 'data-value': key, title,
                                  onclick: () => { press(key); onChange(key); }}, text));
  press(value);
  box.press = press;
  return box;
}

function checkbox(label, id, checked, onChange) {
  const input = element('input', {type: 'checkbox', id, checked});
  input.addEventListener('change', () => onChange(input.checked));
  return element('label', {for: id}, input, label);
}

function section(id, title) {
  const node = element('section', {id, 'aria-labelledby': id + '-title'},
                       element('h2', {id: id + '-title'}, title));
  document.getElementById('main').append(node);
  document.getElementById('nav').append(element('a', {href: '#' + id}, title));
  return node;
}

function saveText(name, type, text) {
  const link = element('a', {download: name, href: URL.createObjectURL(new Blob([text], {type}))});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
