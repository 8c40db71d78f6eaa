// SPDX-License-Identifier: GPL-3.0-or-later
// Builds the page. A part that fails says so and leaves the others alone.

function startPage() {
  document.getElementById('title').textContent = report.title;
  for (const build of [buildStudies, buildFigures, buildComparer, buildScene]) {
    try {
      build();
    } catch (error) {
      console.error(error);
      document.getElementById('main').append(element('p', {class: 'notice'},
                                                     `A part of this page failed: ${error}`));
    }
  }
  document.getElementById('footer').textContent =
    `Written by probelab ${report.version}; ${formatBytes(report.embedded_bytes)} of images, ` +
    'figures and geometry are in this file. It loads nothing from anywhere.';
}

startPage();
