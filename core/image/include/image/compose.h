// SPDX-License-Identifier: Apache-2.0
// Labelled pictures: text, and strips of panels with a caption and legend bars. The font is drawn
// without any file; characters outside printable ASCII show as '?'.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "image/image.h"

namespace probelab {

// `scale` is a whole number of pixels a font unit; capitals are 7 units high.
struct TextSize {
  int width = 0, height = 0;  // in pixels
};
TextSize measureText(std::string_view text, int scale);
// Draws one line with its top left corner at (x, y); what lies outside the picture is cut.
void drawText(ByteImage& image, int x, int y, std::string_view text, int scale,
              Vec3<uint8_t> color);

ByteImage makeByteImage(int width, int height, Vec3<uint8_t> color);
// Copies `source` with its top left corner at (x, y); what lies outside is cut.
void drawImage(ByteImage& target, int x, int y, const ByteImage& source);

// A bar of colours under a panel.
struct Legend {
  enum class Colors { signed_error, false_color } colors = Colors::signed_error;
  std::string low, middle, high;  // what stands at its ends and in the middle
};

struct Panel {
  std::string label;
  ByteImage image;
  std::optional<Legend> legend;
};

struct StripStyle {
  int margin = 10;  // pixels around and between panels
  int text_scale = 2;
  int columns = 0;      // 0: all panels in one row
  std::string caption;  // under the panels; empty: none
};

// The legend of signedErrorMap: "-scale", "0", "+scale" with a unit.
Legend signedErrorLegend(float scale, const std::string& unit = "");

// Panels in rows on white, each under its label. Labels and the caption are wrapped at spaces and
// broken at '\n'; words that are too wide are cut with "..". Panels may differ in size. Throws
// InputError without panels.
ByteImage composePanels(std::span<const Panel> panels, const StripStyle& style = {});

}  // namespace probelab
