// SPDX-License-Identifier: Apache-2.0
// A bitmap font of printable ASCII, in its order. A glyph is nine rows of five pixels from top to
// bottom, a row one base-32 digit (0-9, A-V) whose highest bit is the left pixel. Rows 0 to 6 stand
// on the base line, 7 and 8 hang below it.
#pragma once

#include <array>
#include <string_view>

namespace probelab {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 9;
inline constexpr int kGlyphAdvance = 6;

// clang-format off
inline constexpr std::array<std::string_view, 95> kGlyphs = {
    "000000000", "444440400", "AAA000000", "AAVAVAA00", "4FKE5U400", "OP248J300", "CIK8LID00",
    "448000000", "248884200", "842224800", "04LEL4000", "044V44000", "000000448", "000V00000",
    "00000CC00", "01248G000",
    "EHJLPHE00", "4C4444E00", "EH1248V00", "V2421HE00", "26AIV2200",
    "VGU11HE00", "68GUHHE00", "V12488800", "EHHEHHE00", "EHHF12C00",
    "0CC0CC000", "0CC0C4800", "248G84200", "00V0V0000", "842124800", "EH1240400", "EH1DLLE00",
    "EHHHVHH00", "UHHUHHU00", "EHGGGHE00", "SIHHHIS00", "VGGUGGV00", "VGGUGGG00", "EHGNHHF00",
    "HHHVHHH00", "E44444E00", "72222IC00", "HIKOKIH00", "GGGGGGV00", "HRLLHHH00", "HHPLJHH00",
    "EHHHHHE00", "UHHUGGG00", "EHHHLID00", "UHHUKIH00", "FGGE11U00", "V44444400", "HHHHHHE00",
    "HHHHHA400", "HHHLLLA00", "HHA4AHH00", "HHHA44400", "V1248GV00",
    "E88888E00", "0G8421000", "E22222E00", "4AH000000", "0000000V0", "842000000",
    "00E1FHF00", "GGMPHHU00", "00EGGHE00", "11DJHHF00", "00EHVGE00", "698S88800", "00FHHHF1E",
    "GGMPHHH00", "40C444E00", "2062222IC", "GGIKOKI00", "C44444E00", "00QLLHH00", "00MPHHH00",
    "00EHHHE00", "00UHHHUGG", "00FHHHF11", "00MPGGG00", "00FGE1U00", "88S889600", "00HHHJD00",
    "00HHHA400", "00HHLLA00", "00HA4AH00", "00HHHHF1E", "00V248V00",
    "244844200", "444444400", "844244800", "008L20000"};
// clang-format on

constexpr bool glyphPixel(char character, int x, int y) {
  const bool printable = character >= ' ' && character <= '~';
  const char digit = kGlyphs[static_cast<std::size_t>((printable ? character : '?') - ' ')]
                            [static_cast<std::size_t>(y)];
  const int row = digit <= '9' ? digit - '0' : digit - 'A' + 10;
  return (row >> (kGlyphWidth - 1 - x)) & 1;
}

}  // namespace probelab
