// SPDX-License-Identifier: Apache-2.0
#include "image/compose.h"

#include <algorithm>
#include <cmath>

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

// The text cut with ".." to what fits into `width` pixels.
std::string cutText(std::string_view text, int scale, int width) {
  if (measureText(text, scale).width <= width) return std::string(text);
  std::string shorter(text);
  while (!shorter.empty() && measureText(shorter + "..", scale).width > width) shorter.pop_back();
  return shorter + "..";
}

// One line in `width` pixels, in the largest size up to `scale` in which it fits.
void drawFittedText(ByteImage& image, int x, int y, std::string_view text, int scale, int width) {
  int fitting = scale;
  while (fitting > 1 && measureText(text, fitting).width > width) --fitting;
  const int lowered = (scale - fitting) * 7;  // keeps the base line
  drawText(image, x, y + lowered, cutText(text, fitting, width), fitting, kInk);
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
  fillRectangle(image, x, y, width, 1, kFrame);
  fillRectangle(image, x, y + bar - 1, width, 1, kFrame);
  fillRectangle(image, x, y, 1, bar, kFrame);
  fillRectangle(image, x + width - 1, y, 1, bar, kFrame);
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

struct RowSize {
  int width = 0, height = 0;
  bool has_legend = false;
};

RowSize measureRow(std::span<const Panel> row, int margin) {
  RowSize size;
  for (const Panel& p : row) {
    size.width += p.image.width + margin;
    size.height = std::max(size.height, p.image.height);
    size.has_legend |= p.legend.has_value();
  }
  return size;
}

void drawRow(ByteImage& strip, std::span<const Panel> row, int y, const StripStyle& style) {
  int x = style.margin;
  for (const Panel& p : row) {
    drawFittedText(strip, x, y, p.label, style.text_scale, p.image.width);
    const int top = y + lineHeight(style.text_scale);
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
  std::vector<std::span<const Panel>> rows;
  for (std::size_t i = 0; i < panels.size(); i += columns)
    rows.push_back(panels.subspan(i, std::min(columns, panels.size() - i)));
  const auto heightOf = [&](const RowSize& row) {
    const int legend = row.has_legend ? 3 * style.text_scale + legendHeight(style.text_scale) : 0;
    return lineHeight(style.text_scale) + row.height + legend + style.margin;
  };
  int width = 0, height = style.margin;
  for (const auto& row : rows) {
    const RowSize size = measureRow(row, style.margin);
    width = std::max(width, size.width + style.margin);
    height += heightOf(size);
  }
  if (!style.caption.empty()) height += lineHeight(style.text_scale) + style.margin;
  ByteImage strip = makeByteImage(width, height, kWhite);
  int y = style.margin;
  for (const auto& row : rows) {
    drawRow(strip, row, y, style);
    y += heightOf(measureRow(row, style.margin));
  }
  if (!style.caption.empty())
    drawFittedText(strip, style.margin, y, style.caption, style.text_scale,
                   width - 2 * style.margin);
  return strip;
}

}  // namespace probelab
