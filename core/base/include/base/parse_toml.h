// SPDX-License-Identifier: Apache-2.0
// TOML, with a bad text told from memory that ended while it was read. toml++ is the includer's to
// link.
#pragma once

#include <toml++/toml.h>
#include <new>
#include <string>
#include <string_view>

#include "base/error.h"

namespace probelab {

// Throws toml::parse_error, or std::bad_alloc: streams swallow the latter, so a parser that reads
// numbers with them takes the end of memory for a bad number; but what is wrong with a text is
// wrong twice.
inline toml::table parseTomlTwice(std::string_view text, const std::string& file) {
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error&) {
  }
  (void)toml::parse(text, file);
  throw std::bad_alloc();
}

// The table of a file's text. Throws InputError with the line for anything that is not TOML.
inline toml::table parseToml(std::string_view text, const std::string& file) {
  try {
    return parseTomlTwice(text, file);
  } catch (const toml::parse_error& e) {
    throwInput("{}:{}: is not valid TOML: {}", file, e.source().begin.line,
               printable(std::string(e.description())));
  }
}

}  // namespace probelab
