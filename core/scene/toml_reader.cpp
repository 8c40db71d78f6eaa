// SPDX-License-Identifier: Apache-2.0
#include "toml_reader.h"

#include <algorithm>
#include <cmath>

#include "base/suggest.h"
#include "warnings.h"

namespace probelab {

void TableReader::failAt(const toml::node& node, const std::string& what) const {
  throwInput("{}:{}: {}{}{}", file_, std::max(node.source().begin.line, 1u), element_,
             element_.empty() ? "" : ": ", what);
}

void TableReader::allowOnly(std::initializer_list<const char*> keys) const {
  const std::vector<std::string> known(keys.begin(), keys.end());
  for (const auto& [key, node] : table_) {
    const std::string name(key.str());
    if (std::find(known.begin(), known.end(), name) == known.end())
      failAt(node, fmt::format("unknown key '{}'{}", printable(name), suggestion(name, known)));
  }
}

double TableReader::numberOf(const toml::node& node, const char* key, NumberRange range) const {
  if (!node.is_number()) failAt(node, fmt::format("{} must be a number", key));
  const double value = *node.value<double>();
  // Everything ends up in single precision.
  if (!std::isfinite(static_cast<float>(value)))
    failAt(node, fmt::format("{} is {}, must be finite", key, value));
  if (value < range.min)
    failAt(node, fmt::format("{} is {}, must be {} or more", key, value, range.min));
  if (value > range.max)
    failAt(node, fmt::format("{} is {}, must be {} or less", key, value, range.max));
  return value;
}

Vec3d TableReader::vectorOf(const toml::node& node, const char* key, NumberRange range) const {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != 3)
    failAt(node, fmt::format("{} must be three numbers, [x, y, z]", key));
  return {numberOf((*array)[0], key, range), numberOf((*array)[1], key, range),
          numberOf((*array)[2], key, range)};
}

std::optional<double> TableReader::number(const char* key, NumberRange range) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return std::nullopt;
  return numberOf(*node, key, range);
}

std::optional<std::string> TableReader::text(const char* key) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_string()) failAt(*node, fmt::format("{} must be a string", key));
  std::string value = *node->value<std::string>();
  if (value.empty()) failAt(*node, fmt::format("{} is empty", key));
  return value;
}

std::optional<Vec3d> TableReader::vector(const char* key, NumberRange range) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return std::nullopt;
  return vectorOf(*node, key, range);
}

std::optional<std::size_t> TableReader::choice(const char* key,
                                               std::initializer_list<const char*> names) const {
  const std::optional<std::string> value = text(key);
  if (!value) return std::nullopt;
  const std::vector<std::string> known(names.begin(), names.end());
  const auto it = std::find(known.begin(), known.end(), *value);
  if (it == known.end())
    fail(key, "{} is '{}', which is not known{}", key, printable(*value),
         suggestion(*value, known));
  return it - known.begin();
}

std::vector<Vec3d> TableReader::vectors(const char* key, NumberRange range) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return {};
  if (!node->is_array()) failAt(*node, fmt::format("{} must be a list of [x, y, z]", key));
  std::vector<Vec3d> result;
  for (const toml::node& entry : *node->as_array()) result.push_back(vectorOf(entry, key, range));
  return result;
}

std::optional<TableReader> TableReader::table(const char* key, const std::string& element) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) failAt(*node, fmt::format("{} must be a table, [{}]", key, key));
  return TableReader(*node->as_table(), file_, element);
}

std::vector<TableReader> TableReader::tables(const char* key) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) return {};
  const std::string element = fmt::format("[[{}]]", key);
  if (!node->is_array()) failAt(*node, fmt::format("{} is a list: write {}", key, element));
  std::vector<TableReader> result;
  for (const toml::node& entry : *node->as_array()) {
    if (!entry.is_table())
      failAt(entry, fmt::format("{} must hold tables: write {}", key, element));
    result.emplace_back(*entry.as_table(), file_, element);
  }
  return result;
}

std::vector<std::pair<std::string, TableReader>> TableReader::members() const {
  std::vector<std::pair<std::string, TableReader>> result;
  for (const auto& [key, node] : table_) {
    const std::string name(key.str());
    if (!node.is_table())
      failAt(node, fmt::format("'{}' must be a table, {{ ... }}", printable(name)));
    result.emplace_back(name, TableReader(*node.as_table(), file_,
                                          fmt::format("{}, '{}'", element_, printable(name))));
  }
  return result;
}

}  // namespace probelab
