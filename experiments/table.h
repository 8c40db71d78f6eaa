// SPDX-License-Identifier: GPL-3.0-or-later
// Plain text tables for stdout.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace probelab {

// Columns as wide as their widest cell, two spaces apart; the first is left-aligned, the others are
// aligned as `right` says (default: to the right, for numbers).
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header, bool right = true);
  void addRow(std::vector<std::string> cells);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
  bool right_;
};

// "label   value" lines with the values aligned; an empty label continues the line above.
std::string formatFields(const std::vector<std::pair<std::string, std::string>>& fields);

// 4 significant digits ("0.01234", "1.2e-08"); "-" when there is none or it is not finite.
std::string formatNumber(const std::optional<double>& value);
// "12.3 MiB".
std::string formatBytes(double bytes);

}  // namespace probelab
