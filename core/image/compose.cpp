// SPDX-License-Identifier: Apache-2.0
#include "image/compose.h"

#include <algorithm>
#include <sstream>
#include <utility>
#include <vector>

#include "base/error.h"
#include "font.h"
#include "image/tonemap.h"

namespace probelab {
namespace {

constexpr Vec3<uint8_t> kWhite(255, 255, 255);
constexpr Vec3<uint8_t> kInk(20, 20, 20);
constexpr Vec3<uint8_t> kFrame(160, 160, 160);
constexpr int kLegendBarUnits = 6;  // height in font units

void setPixel(ByteImage& image, int x, int y, Vec3<uint8_t> color) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  const std::size_t i = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                             static_cast<std::size_t>(x));
  image.rgb[i] = color.x, image.rgb[i + 1] = color.y, image.rgb[i + 2] = color.z;
}

void fillRectangle(ByteImage& image, int x, int y, int width, int height, Vec3<uint8_t> color) {
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) setPixel(image, x + u, y + v, color);
}

int lineHeight(int scale) { return (kGlyphHeight + 2) * scale; }

// Lines that fit into `width` pixels: broken at '\n' and at spaces; longer words are cut with "..".
std::vector<std::string> wrapText(const std::string& text, int scale, int width) {
  const auto fits = [&](const std::string& line) {
    return measureText(line, scale).width <= width;
  };
  std::vector<std::string> lines;
  std::istringstream paragraphs(text);
  for (std::string paragraph; std::getline(paragraphs, paragraph);) {
    std::istringstream words(paragraph);
    std::string line;
    for (std::string word; words >> word;) {
      if (!fits(word)) {
        while (!word.empty() && !fits(word + "..")) word.pop_back();
        word += "..";
      }
      const std::string longer = line.empty() ? word : line + " " + word;
      if (fits(longer)) {
        line = longer;
      } else {
        lines.push_back(std::exchange(line, word));
      }
    }
    lines.push_back(line);
  }
  return lines;
}

void drawLines(ByteImage& image, int x, int y, std::span<const std::string> lines, int scale) {
  for (const std::string& line : lines) {
    drawText(image, x, y, line, scale, kInk);
    y += lineHeight(scale);
  }
}

void drawFrame(ByteImage& image, int x, int y, int width, int height) {
  fillRectangle(image, x, y, width, 1, kFrame);
  fillRectangle(image, x, y + height - 1, width, 1, kFrame);
  fillRectangle(image, x, y, 1, height, kFrame);
  fillRectangle(image, x + width - 1, y, 1, height, kFrame);
}

int legendHeight(int scale) { return kLegendBarUnits * scale + lineHeight(scale) + scale; }

void drawLegend(ByteImage& image, int x, int y, int width, const Legend& legend, int scale) {
  const int bar = kLegendBarUnits * scale;
  for (int u = 0; u < width; ++u) {
    const float t = width > 1 ? float(u) / float(width - 1) : 0.5f;
    const bool is_signed = legend.colors == Legend::Colors::signed_error;
    fillRectangle(image, x + u, y, 1, bar,
                  is_signed ? signedErrorColor(2 * t - 1) : falseColorOf(t));
  }
  drawFrame(image, x, y, width, bar);
  int fitting = scale;
  const std::string all = legend.low + "  " + legend.middle + "  " + legend.high;
  while (fitting > 1 && measureText(all, fitting).width > width) --fitting;
  const int text_y = y + bar + 2 * scale;
  drawText(image, x, text_y, legend.low, fitting, kInk);
  drawText(image, x + (width - measureText(legend.middle, fitting).width) / 2, text_y,
           legend.middle, fitting, kInk);
  drawText(image, x + width - measureText(legend.high, fitting).width, text_y, legend.high, fitting,
           kInk);
}

// Panels side by side, their wrapped labels, and the room they need.
struct Row {
  std::span<const Panel> panels;
  std::vector<std::vector<std::string>> labels;
  int width = 0, label_height = 0, image_height = 0, legend_height = 0;
  int height() const { return label_height + image_height + legend_height; }
};

Row layOutRow(std::span<const Panel> panels, const StripStyle& style) {
  const int scale = style.text_scale;
  Row row{panels, {}};
  for (const Panel& p : panels) {
    row.labels.push_back(wrapText(p.label, scale, p.image.width));
    row.width += p.image.width + style.margin;
    row.label_height =
        std::max(row.label_height, static_cast<int>(row.labels.back().size()) * lineHeight(scale));
    row.image_height = std::max(row.image_height, p.image.height);
    if (p.legend) row.legend_height = 3 * scale + legendHeight(scale);
  }
  return row;
}

void drawRow(ByteImage& strip, const Row& row, int y, const StripStyle& style) {
  int x = style.margin;
  const int top = y + row.label_height;
  for (std::size_t i = 0; i < row.panels.size(); ++i) {
    const Panel& p = row.panels[i];
    drawLines(strip, x, y, row.labels[i], style.text_scale);
    drawFrame(strip, x - 1, top - 1, p.image.width + 2, p.image.height + 2);
    drawImage(strip, x, top, p.image);
    if (p.legend)
      drawLegend(strip, x, top + p.image.height + 3 * style.text_scale, p.image.width, *p.legend,
                 style.text_scale);
    x += p.image.width + style.margin;
  }
}

}  // namespace

TextSize measureText(std::string_view text, int scale) {
  const int count = static_cast<int>(text.size());
  return {count == 0 ? 0 : (count * kGlyphAdvance - (kGlyphAdvance - kGlyphWidth)) * scale,
          kGlyphHeight * scale};
}

void drawText(ByteImage& image, int x, int y, std::string_view text, int scale,
              Vec3<uint8_t> color) {
  PROBELAB_CHECK(scale > 0);
  for (const char character : text) {
    for (int v = 0; v < kGlyphHeight; ++v)
      for (int u = 0; u < kGlyphWidth; ++u)
        if (glyphPixel(character, u, v))
          fillRectangle(image, x + u * scale, y + v * scale, scale, scale, color);
    x += kGlyphAdvance * scale;
  }
}

ByteImage makeByteImage(int width, int height, Vec3<uint8_t> color) {
  PROBELAB_CHECK(width > 0 && height > 0);
  ByteImage image{width, height, {}};
  image.rgb.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  fillRectangle(image, 0, 0, width, height, color);
  return image;
}

void drawImage(ByteImage& target, int x, int y, const ByteImage& source) {
  for (int v = 0; v < source.height; ++v)
    for (int u = 0; u < source.width; ++u) {
      const uint8_t* c = source.rgb.data() +
                         3 * (static_cast<std::size_t>(v) * static_cast<std::size_t>(source.width) +
                              static_cast<std::size_t>(u));
      setPixel(target, x + u, y + v, {c[0], c[1], c[2]});
    }
}

Legend signedErrorLegend(float scale, const std::string& unit) {
  const std::string suffix = unit.empty() ? "" : " " + unit;
  return {Legend::Colors::signed_error, fmt::format("-{:.3g}{}", scale, suffix), "0",
          fmt::format("+{:.3g}{}", scale, suffix)};
}

ByteImage composePanels(std::span<const Panel> panels, const StripStyle& style) {
  if (panels.empty()) throwInput("picture: there are no panels to put together");
  PROBELAB_CHECK(style.text_scale > 0 && style.margin >= 0);
  const std::size_t columns =
      style.columns > 0 ? static_cast<std::size_t>(style.columns) : panels.size();
  std::vector<Row> rows;
  int width = 0, height = style.margin;
  for (std::size_t i = 0; i < panels.size(); i += columns) {
    rows.push_back(layOutRow(panels.subspan(i, std::min(columns, panels.size() - i)), style));
    width = std::max(width, rows.back().width + style.margin);
    height += rows.back().height() + style.margin;
  }
  const auto caption = wrapText(style.caption, style.text_scale, width - 2 * style.margin);
  if (!caption.empty())
    height += static_cast<int>(caption.size()) * lineHeight(style.text_scale) + style.margin;
  ByteImage strip = makeByteImage(width, height, kWhite);
  int y = style.margin;
  for (const Row& row : rows) {
    drawRow(strip, row, y, style);
    y += row.height() + style.margin;
  }
  drawLines(strip, style.margin, y, caption, style.text_scale);
  return strip;
}

}  // namespace probelab
