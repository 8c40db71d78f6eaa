// SPDX-License-Identifier: GPL-3.0-or-later
// --require 'nrmse<=0.05': a condition on a number of a command's JSON. Unmet ones end the program
// with exit code 3, so that scripts and continuous integration can hold results to a bound.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "json.h"
#include "program.h"

namespace CLI {
class App;
}

namespace probelab {

// Exit code 3.
class RequirementNotMet : public Error {
 public:
  explicit RequirementNotMet(const std::string& message) : Error(message, 3) {}
};

enum class Comparison { less_equal, less, greater_equal, greater, equal };

struct Requirement {
  std::string name;  // dotted path into the JSON: "error.nrmse", or "nrmse" for short
  Comparison comparison = Comparison::less_equal;
  double wanted = 0;
};

// "NAME<=NUMBER", with <=, <, >=, > or ==. Throws InputError.
Requirement parseRequirement(const std::string& text);

// The option, repeatable; values are parsed while the command line is read.
void addRequireOption(CLI::App& app, std::vector<std::string>& texts);

// Throws InputError for a name that `result` does not have (with the nearest one) or whose value is
// null, RequirementNotMet naming all that are not met: name, wanted, measured. A name is looked up
// from the root, then in "error" and in "speed".
void checkRequirements(const std::vector<std::string>& texts, const Json& result);

// Before the work: throws InputError for a name that no result with this outline can have. The
// outline has the names of the result; values do not matter, and below an empty object or array any
// name may come.
void checkRequirementNames(const std::vector<std::string>& texts, const Json& outline);

// The end of every command: prints the result on stdout, as JSON or by `print_text`, and holds it
// to
// --require.
void reportResult(const Invocation& invocation, const Json& result,
                  const std::function<void()>& print_text);

}  // namespace probelab
