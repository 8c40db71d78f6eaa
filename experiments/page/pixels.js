// SPDX-License-Identifier: GPL-3.0-or-later
// The pixels of a set of images and the colours in which they are shown.

const notFiniteColor = [255, 0, 255];

function makeSrgbTable() {
  const table = new Uint8ClampedArray(4097);
  for (let i = 0; i <= 4096; ++i) {
    const v = i / 4096;
    table[i] = 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  }
  return table;
}

class ImageColors {
  constructor(set) {
    this.images = set.images.map((image) => ({
      name: image.name,
      pixels: set.precision === 'half' ? blobHalves(image.blob) : blobFloats(image.blob),
      notFinite: image.not_finite}));
    this.count = set.width * set.height;
    this.referenceIndex = set.reference;
    this.reference = this.images[set.reference].pixels;
    this.srgb = makeSrgbTable();
  }

  // The largest |difference| of luminance but for the top percent, of all images.
  suggestErrorScale() {
    let scale = 0;
    this.images.forEach((image, k) => {
      if (k === this.referenceIndex) return;
      const values = new Float32Array(this.count);
      for (let i = 0; i < this.count; ++i)
        values[i] = Math.abs(luminanceOf(image.pixels, i) - luminanceOf(this.reference, i));
      const finite = values.filter(Number.isFinite);
      scale = Math.max(scale, percentileOf(finite, 0.99) || percentileOf(finite, 1));
    });
    return scale > 0 ? Number(scale.toPrecision(2)) : 1;
  }

  suggestFalseMost() {
    const values = new Float32Array(this.count);
    for (let i = 0; i < this.count; ++i) values[i] = luminanceOf(this.reference, i);
    const most = percentileOf(values.filter(Number.isFinite), 0.99);
    return most > 0 ? Number(most.toPrecision(2)) : 1;
  }

  // Image k as `settings` (show, exposure, errorScale, falseMost) want it, as RGBA bytes.
  paint(k, settings, data) {
    const pixels = this.images[k].pixels;
    if (settings.show === 'tone') this.paintTone(pixels, settings.exposure, data);
    else if (settings.show === 'error') this.paintError(pixels, settings.errorScale, data);
    else this.paintTable(falseTable, data, (i) => luminanceOf(pixels, i) / settings.falseMost);
  }

  paintTone(pixels, exposure, data) {
    const steps = this.srgb.length - 1, gain = 2 ** exposure * steps;
    for (let i = 0; i < this.count; ++i) {
      const finite = Number.isFinite(pixels[3 * i] + pixels[3 * i + 1] + pixels[3 * i + 2]);
      for (let c = 0; c < 3; ++c)
        data[4 * i + c] = finite
          ? this.srgb[Math.round(Math.min(steps, Math.max(0, gain * pixels[3 * i + c])))]
          : notFiniteColor[c];
      data[4 * i + 3] = 255;
    }
  }

  paintError(pixels, scale, data) {
    this.paintTable(errorTable, data, (i) =>
      0.5 + 0.5 * (luminanceOf(pixels, i) - luminanceOf(this.reference, i)) / scale);
  }

  // The colour at the share of the table that `shareOf` gives a pixel.
  paintTable(table, data, shareOf) {
    for (let i = 0; i < this.count; ++i) {
      const t = shareOf(i), at = 3 * Math.round(255 * Math.min(1, Math.max(0, t)));
      for (let c = 0; c < 3; ++c)
        data[4 * i + c] = Number.isFinite(t) ? table[at + c] : notFiniteColor[c];
      data[4 * i + 3] = 255;
    }
  }
}
