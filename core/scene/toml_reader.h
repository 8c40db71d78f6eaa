// SPDX-License-Identifier: Apache-2.0
// Typed, checked access to the tables of a TOML file. Every error is one line that starts with
// "file:line: [table]".
#pragma once

#include <fmt/format.h>

#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parse_toml.h"
#include "base/vec.h"

namespace probelab {

struct NumberRange {
  double min = std::numeric_limits<double>::lowest();
  double max = std::numeric_limits<double>::max();
};
inline constexpr NumberRange kNotNegative{0};

class TableReader {
 public:
  // `element`: how messages call the table, as in "[sky]"; empty for the file itself.
  TableReader(const toml::table& table, std::string file, std::string element)
      : table_(table), file_(std::move(file)), element_(std::move(element)) {}

  // Throws InputError for any other key, with the nearest of these.
  void allowOnly(std::initializer_list<const char*> keys) const;

  bool has(const char* key) const { return table_.contains(key); }
  // Nothing where the key is missing. Throw InputError for a wrong type, a number outside `range`
  // or not finite, an empty string.
  std::optional<double> number(const char* key, NumberRange range = {}) const;
  std::optional<std::string> text(const char* key) const;
  std::optional<Vec3d> vector(const char* key, NumberRange range = {}) const;
  // One of `names`: its place in the list.
  std::optional<std::size_t> choice(const char* key,
                                    std::initializer_list<const char*> names) const;
  // A list of [x, y, z].
  std::vector<Vec3d> vectors(const char* key, NumberRange range = {}) const;
  std::optional<TableReader> table(const char* key, const std::string& element) const;
  // The tables of [[key]].
  std::vector<TableReader> tables(const char* key) const;
  // Its keys, each of them a table.
  std::vector<std::pair<std::string, TableReader>> members() const;

  // Throws InputError at the key's line (the table's where it is missing).
  template <class... Args>
  [[noreturn]] void fail(const char* key, fmt::format_string<Args...> format,
                         Args&&... args) const {
    failAt(table_.get(key) != nullptr ? *table_.get(key) : table_,
           fmt::format(format, std::forward<Args>(args)...));
  }
  template <class T>
  const T& required(const char* key, const std::optional<T>& value) const {
    if (!value) fail(key, "{} is missing", key);
    return *value;
  }

  void rename(std::string element) { element_ = std::move(element); }

 private:
  [[noreturn]] void failAt(const toml::node& node, const std::string& what) const;
  double numberOf(const toml::node& node, const char* key, NumberRange range) const;
  Vec3d vectorOf(const toml::node& node, const char* key, NumberRange range) const;

  const toml::table& table_;
  std::string file_, element_;
};

}  // namespace probelab
