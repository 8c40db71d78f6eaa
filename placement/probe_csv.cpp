// SPDX-License-Identifier: GPL-3.0-or-later
#include <cctype>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/files.h"
#include "probe_files.h"

namespace probelab {
namespace {

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string_view> cellsOf(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0;;) {
    const std::size_t comma = line.find(',', begin);
    cells.push_back(trimmed(line.substr(begin, comma - begin)));
    if (comma == std::string_view::npos) return cells;
    begin = comma + 1;
  }
}

bool isLetter(std::string_view text) {
  return text.size() == 1 && std::isalpha(static_cast<unsigned char>(text[0])) != 0;
}

// Columns in another order would be read as x, y, z.
void checkHeader(const std::vector<std::string_view>& cells, const std::filesystem::path& path,
                 int line) {
  std::string names;
  for (const std::string_view cell : cells) {
    if (!names.empty()) names += ',';
    for (const char c : cell)
      names += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  if (names != "x,y,z" && names != "x,y,z,pinned")
    throwInput("{}: line {}: the columns are '{}'; x,y,z or x,y,z,pinned is needed", path.string(),
               line, printable(names));
}

bool readNumber(std::string_view text, double& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

}  // namespace

FilePoints readCsvPoints(const std::filesystem::path& path) {
  const std::string text = readCsvFile(path);
  FilePoints points;
  bool first = true;
  int number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    ++number;
    if (line.empty() || line.starts_with('#')) continue;
    const std::vector<std::string_view> cells = cellsOf(line);
    const bool header = first && isLetter(cells[0]);
    first = false;
    if (header) {
      checkHeader(cells, path, number);
      continue;
    }
    Vec3d p;
    double pinned = 0;
    const bool right =
        (cells.size() == 3 || cells.size() == 4) && readNumber(cells[0], p.x) &&
        readNumber(cells[1], p.y) && readNumber(cells[2], p.z) &&
        (cells.size() == 3 || (readNumber(cells[3], pinned) && (pinned == 0 || pinned == 1)));
    if (!right)
      throwInput("{}: line {}: x,y,z or x,y,z,pinned is needed, pinned 0 or 1", path.string(),
                 number);
    points.world.push_back(p);
    points.pinned.push_back(pinned == 1 ? 1 : 0);
  }
  return points;
}

}  // namespace probelab
