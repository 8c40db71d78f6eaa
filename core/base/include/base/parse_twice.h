// SPDX-License-Identifier: Apache-2.0
// Telling a bad text from memory that ended while it was read.
#pragma once

#include <new>

namespace probelab {

// What parse() returns. Streams swallow std::bad_alloc, so a parser that reads numbers with them
// takes the end of memory for a bad number; but what is wrong with a text is wrong twice. Throws
// the Error of the second reading, or std::bad_alloc if that finds nothing.
template <class Error, class Parse>
auto parseTwice(const Parse& parse) {
  try {
    return parse();
  } catch (const Error&) {
  }
  parse();
  throw std::bad_alloc();
}

}  // namespace probelab
