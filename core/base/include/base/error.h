// SPDX-License-Identifier: Apache-2.0
// Errors. Bad input throws one of these and is caught once, in main, where the kind decides the exit
// code; CHECK is for our own bugs and aborts. A message says what is wrong, where (file, element)
// and what to do about it, in one line.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace probelab {

// Exit code 1: the program could not do what was asked (a device is lost, a disk is full).
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message, int exit_code = 1)
      : std::runtime_error(message), exit_code_(exit_code) {}
  int exitCode() const { return exit_code_; }

 private:
  int exit_code_;
};

// Exit code 2: wrong usage or bad input (files, parameters, names).
class InputError : public Error {
 public:
  explicit InputError(const std::string& message) : Error(message, 2) {}
};

// Exit code 1: no suitable Vulkan device, a missing feature, a lost device.
class DeviceError : public Error {
 public:
  explicit DeviceError(const std::string& message) : Error(message, 1) {}
};

// Exit code 1: a NaN or Inf in a result; the message names the stage.
class NumericalError : public Error {
 public:
  explicit NumericalError(const std::string& message) : Error(message, 1) {}
};

// Exit code 130: SIGINT arrived (base/interrupt.h).
class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted", 130) {}
};

// `text` of a file for a message: control characters become '?', and what is beyond `limit` bytes is
// cut off.
std::string printable(const std::string& text, std::size_t limit = 200);

// On stderr. One that is closed or full is no reason to lose a result, so nothing is thrown.
void printToStderr(std::string_view text);

[[noreturn]] void checkFailed(const char* expression, const char* file, int line,
                              const std::string& detail);

template <class... Args>
[[noreturn]] void throwInput(fmt::format_string<Args...> format, Args&&... args) {
  throw InputError(fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace probelab

// Aborts with the expression and the place: a broken invariant is a bug in this program.
#define PROBELAB_CHECK(condition)                                                    \
  do {                                                                               \
    if (!(condition)) ::probelab::checkFailed(#condition, __FILE__, __LINE__, "");   \
  } while (false)
// The same for a == b, printing both values.
#define PROBELAB_CHECK_EQ(a, b)                                                      \
  do {                                                                               \
    const auto& check_a_ = (a);                                                      \
    const auto& check_b_ = (b);                                                      \
    if (!(check_a_ == check_b_))                                                     \
      ::probelab::checkFailed(#a " == " #b, __FILE__, __LINE__,                      \
                              fmt::format("{} against {}", check_a_, check_b_));     \
  } while (false)
