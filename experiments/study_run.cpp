// SPDX-License-Identifier: GPL-3.0-or-later
#include "study_run.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/files.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "result_numbers.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

constexpr uintmax_t kSpaceForLog = 4096;  // bytes

void makeFolder(const fs::path& folder) {
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (ec) throwInput("--results {}: cannot be created: {}", folder.string(), ec.message());
}

// What the program itself is, for its children.
std::string ownProgram() {
  std::error_code ec;
  const fs::path program = fs::read_symlink("/proc/self/exe", ec);
  if (ec) throw Error("the program's own path cannot be found: " + ec.message());
  return program.string();
}

// Of an open file.
class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  Descriptor(Descriptor&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(file_, other.file_);
    return *this;
  }
  ~Descriptor() {
    if (file_ >= 0) close(file_);
  }
  int get() const { return file_; }

 private:
  int file_;
};

struct Child {
  pid_t pid = -1;
  const StudyCell* cell = nullptr;
  fs::path output, log;
  Descriptor locked;  // the log: whoever runs a cell holds its lock
  Timer timer;
};

std::vector<std::string> childArguments(const StudyCell& cell, const StudyRun& run,
                                        const CommonOptions& common) {
  std::vector<std::string> arguments = cellArguments(cell, run.folder / "files" / cell.id);
  arguments.insert(arguments.end(), {"--json", "--cache", common.cache});
  if (!common.device.empty()) arguments.insert(arguments.end(), {"--device", common.device});
  if (common.validation) arguments.push_back("--validation");
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const unsigned threads = common.threads > 0
                               ? static_cast<unsigned>(common.threads)
                               : std::max(1u, cores / static_cast<unsigned>(run.jobs));
  if (common.threads > 0 || run.jobs > 1)
    arguments.insert(arguments.end(), {"--threads", std::to_string(threads)});
  return arguments;
}

// In the child: files in place of the standard streams, then the program. Never returns. Only
// calls that are safe after fork.
[[noreturn]] void becomeCell(char* const* argv, int output, int log, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);  // it died before
  const int null = open("/dev/null", O_RDONLY);
  dup2(null, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  execv(argv[0], argv);
  _exit(127);
}

Descriptor openForWriting(const fs::path& path, int more_flags) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | more_flags, 0644);
  if (file < 0)
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  return Descriptor(file);
}

fs::path logFile(const StudyRun& run, const StudyCell& cell) {
  return run.folder / "logs" / (cell.id + ".txt");
}

// The log of a cell with its lock, which the cell's process shares and which ends with both;
// nothing while another run has it. Where the file system knows no locks, both run the cell.
std::optional<Descriptor> lockLog(const fs::path& path) {
  Descriptor log = openForWriting(path, O_NONBLOCK);  // a pipe in its place must not hold us up
  if (flock(log.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return std::nullopt;
  return log;
}

Child startCell(const StudyCell& cell, const StudyRun& run, Descriptor log,
                const std::string& program, const CommonOptions& common) {
  Child child{.cell = &cell,
              .output = run.folder / "cells" / fmt::format(".{}.{}.out", cell.id, processTag()),
              .log = logFile(run, cell),
              .locked = std::move(log),
              .timer = {}};
  if (ftruncate(child.locked.get(), 0) != 0)
    throw Error(fmt::format("{}: cannot be emptied: {}", child.log.string(), std::strerror(errno)));
  const fs::path files = run.folder / "files" / cell.id;
  std::set<fs::path> folders;
  for (const fs::path& output : cellOutputs(cell, false))
    folders.insert((files / output).parent_path());
  for (const fs::path& output : cellOutputs(cell, true)) folders.insert(files / output);
  for (const fs::path& folder : folders) {
    makeFolder(folder);
    removeLeftOvers(folder);  // of a run of this cell that was killed
  }
  std::vector<std::string> words = {program};
  for (std::string& word : childArguments(cell, run, common)) words.push_back(std::move(word));
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const Descriptor output = openForWriting(child.output, O_TRUNC);
  const pid_t parent = getpid();
  child.pid = fork();
  if (child.pid == 0) becomeCell(argv.data(), output.get(), child.locked.get(), parent);
  if (child.pid < 0)
    throw Error(fmt::format("no process can be started: {}", std::strerror(errno)));
  return child;
}

// The last line that says something.
std::string lastLine(const fs::path& log) {
  std::string text = readTextFile(log);
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text.substr(text.find_last_of('\n') + 1);
}

std::string failureOf(const Child& child, int status) {
  const std::string said = lastLine(child.log);
  if (WIFSIGNALED(status))
    return fmt::format("ended by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  if (!said.empty()) return said;
  std::error_code ec;
  const bool full = fs::space(child.log.parent_path(), ec).available < kSpaceForLog;
  return fmt::format("exit code {}{}", WEXITSTATUS(status),
                     !ec && full ? ", and no space is left to say why" : "");
}

Json describeCell(const Study& study, const StudyCell& cell, double seconds) {
  Json axes = Json::object();
  for (const auto& [name, value] : cell.axes) axes[name] = value;
  Json options = Json::object();
  for (const auto& [name, values] : cell.options) options[name] = values;
  return {{"id", cell.id}, {"study", study.name}, {"command", cell.command}, {"scene", cell.scene},
          {"axes", axes},  {"options", options},  {"seconds", seconds}};
}

// A result that was found, where the study has other names for its axes by now.
void renameCell(const Study& study, const StudyRun& run, const StudyCell& cell, Json& result) {
  Json& own = result["cell"];
  const Json now = describeCell(study, cell, own.value("seconds", 0.0));
  if (own.value("axes", Json()) == now["axes"] && own.value("study", Json()) == now["study"])
    return;
  own = now;
  writeTextFile(cellFile(run, cell), result.dump(1) + "\n");
}

// The child's output as the cell's result; an error text where it is none.
std::string keepResult(const Study& study, const StudyRun& run, const Child& child) {
  Json result = Json::parse(readTextFile(child.output), nullptr, false);
  if (!result.is_object()) return "the command printed no JSON";
  result["cell"] = describeCell(study, *child.cell, child.timer.seconds());
  writeTextFile(cellFile(run, *child.cell), result.dump(1) + "\n");
  return "";
}

class CellRunner {
 public:
  CellRunner(const Study& study, const StudyRun& run, const Invocation& invocation)
      : study_(study), run_(run), invocation_(invocation), program_(ownProgram()) {}

  StudyOutcome run(const std::vector<const StudyCell*>& cells) {
    const Timer timer;
    makeFolder(run_.folder / "cells");
    makeFolder(run_.folder / "logs");
    for (const char* part : {"cells", "logs"}) checkWritable(run_.folder / part / "x");
    removeLeftOvers(run_.folder / "cells");
    removeLeftOvers(invocation_.common.cache);
    std::vector<const StudyCell*> missing;
    for (const StudyCell* cell : cells)
      if (std::optional<Json> found = readCell(run_, *cell)) {
        renameCell(study_, run_, *cell, *found);
        ++outcome_.found;
      } else {
        missing.push_back(cell);
      }
    planWork(missing);
    Progress progress(study_.name, total_, invocation_.common.quiet);
    std::deque<const StudyCell*> waiting(missing.begin(), missing.end());
    try {
      while (!waiting.empty() || !children_.empty()) {
        throwIfInterrupted();
        // Those that another run has in hand go to the end; a round of them is enough at once.
        for (std::size_t i = waiting.size(); i > 0 && hasRoom(); --i) {
          const StudyCell* cell = waiting.front();
          waiting.pop_front();
          if (!start(*cell)) waiting.push_back(cell);
        }
        if (children_.empty()) tellWaiting(waiting.size());
        if (!reap()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
        progress.update(finished_);
      }
    } catch (...) {
      endChildren();
      throw;
    }
    progress.finish();
    outcome_.seconds = timer.seconds();
    return std::move(outcome_);
  }

 private:
  void tellWaiting(std::size_t cells) {
    if (cells == 0 || told_waiting_) return;
    note(invocation_, "waiting for {} cell{} that another run has in hand", cells,
         cells == 1 ? "" : "s");
    told_waiting_ = true;
  }

  bool hasRoom() const { return static_cast<int>(children_.size()) < run_.jobs; }

  // False while another process has it in hand, which may also have finished it meanwhile.
  bool start(const StudyCell& cell) {
    std::optional<Descriptor> log;
    try {
      log = lockLog(logFile(run_, cell));
    } catch (const Error& error) {
      fail(cell, error.what());
      return true;
    }
    if (!log) return false;
    if (readCell(run_, cell)) {
      ++outcome_.found;
      finished_ += seconds_[&cell];
    } else {
      children_.push_back(
          startCell(cell, run_, std::move(*log), program_, invocation_.common));
    }
    return true;
  }

  void planWork(const std::vector<const StudyCell*>& missing) {
    std::vector<std::optional<Json>> results;
    for (const StudyCell& cell : study_.cells) results.push_back(readCell(run_, cell));
    for (const StudyCell* cell : missing)
      total_ += seconds_[cell] = estimateSeconds(study_, *cell, results);
  }

  // Takes in the children that have ended; whether there was one.
  bool reap() {
    bool any = false;
    for (std::size_t i = 0; i < children_.size();) {
      int status = 0;
      if (waitpid(children_[i].pid, &status, WNOHANG) != children_[i].pid) {
        ++i;
        continue;
      }
      const Child child = std::move(children_[i]);
      children_.erase(children_.begin() + static_cast<std::ptrdiff_t>(i));
      any = true;
      settle(child, status);
    }
    return any;
  }

  void settle(const Child& child, int status) {
    const bool ok = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    std::string error;
    try {
      error = ok ? keepResult(study_, run_, child) : failureOf(child, status);
    } catch (...) {
      removeOutput(child);
      throw;
    }
    removeOutput(child);
    throwIfInterrupted();  // a signal to all of us, and no failure
    if (error.empty()) {
      finished_ += seconds_[child.cell];
      ++outcome_.done;
    } else {
      fail(*child.cell, error);
    }
  }

  void fail(const StudyCell& cell, const std::string& error) {
    finished_ += seconds_[&cell];
    outcome_.failures.push_back({&cell, error});
    note(invocation_, "failed: {} ({}): {}", cell.id, axesText(cell), error);
  }

  static void removeOutput(const Child& child) {
    std::error_code ec;
    fs::remove(child.output, ec);
  }

  void endChildren() {
    for (const Child& child : children_) kill(child.pid, SIGINT);
    for (const Child& child : children_) {
      waitpid(child.pid, nullptr, 0);
      removeOutput(child);
    }
    children_.clear();
  }

  const Study& study_;
  const StudyRun& run_;
  const Invocation& invocation_;
  std::string program_;
  std::vector<Child> children_;
  std::map<const StudyCell*, double> seconds_;
  double total_ = 0, finished_ = 0;
  bool told_waiting_ = false;
  StudyOutcome outcome_;
};

// A number that is called as an axis is must not stand in its place.
void renameColumn(const std::string& axis, std::map<std::string, std::string>& row,
                  std::vector<std::string>& columns) {
  const auto number = row.extract(axis);
  if (number.empty()) return;
  const std::string name = "result." + axis;
  row[name] = number.mapped();
  std::erase(columns, axis);
  if (std::find(columns.begin(), columns.end(), name) == columns.end()) columns.push_back(name);
}

std::string quoteCsv(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

fs::path cellFile(const StudyRun& run, const StudyCell& cell) {
  return run.folder / "cells" / (cell.id + ".json");
}

std::optional<Json> readCell(const StudyRun& run, const StudyCell& cell) {
  const fs::path path = cellFile(run, cell);
  std::error_code ec;
  if (!fs::is_regular_file(path, ec)) return std::nullopt;
  Json json = Json::parse(readTextFile(path), nullptr, false);
  if (!json.is_object() || json.size() < 2) return std::nullopt;
  const auto own = json.find("cell");
  if (own == json.end() || !own->is_object()) return std::nullopt;
  const auto id = own->find("id"), seconds = own->find("seconds");
  if (id == own->end() || *id != cell.id || seconds == own->end() || !seconds->is_number())
    return std::nullopt;
  for (const bool folders : {false, true})
    for (const fs::path& output : cellOutputs(cell, folders)) {
      const fs::path made = run.folder / "files" / cell.id / output;
      if (!fs::exists(made, ec) || (folders && fs::is_empty(made, ec))) return std::nullopt;
    }
  return json;
}

namespace {

// What a cell's options say about its time, s on two processor cores: truth, start, and the rays of
// its updates (with some 70 of the burn-in when converged). Only its ratios count once a cell is
// done.
double roughSeconds(const StudyCell& cell) {
  const auto number = [&](const char* name, double otherwise) {
    const auto found = cell.options.find(name);
    if (found == cell.options.end() || found->second.empty()) return otherwise;
    const double value = std::atof(found->second[0].c_str());
    return std::isfinite(value) ? value : otherwise;  // the cell will refuse it
  };
  const auto mode = cell.options.find("mode");
  const bool temporal =
      mode != cell.options.end() && mode->second == OptionValues::mapped_type{"temporal"};
  const double updates = number("updates", 64) + (temporal ? 0 : 70);
  const double rays = number("probes", 512) * number("rays", 128) * updates;
  const double paths =
      cell.command == "budget" ? number("probes", 512) * number("exact-rays", 16384) : 0;
  const double fields = cell.command == "tune" ? 20 : 1;
  return 1 + number("count", 4096) / 1000 + 2 * paths / 1e6 + fields * (0.3 + rays / 2e6);
}

}  // namespace

double estimateSeconds(const Study& study, const StudyCell& cell,
                       const std::vector<std::optional<Json>>& results) {
  const double guess = roughSeconds(cell);
  double best_match = -1, seconds = guess;
  for (std::size_t i = 0; i < study.cells.size(); ++i) {
    if (!results[i]) continue;
    double match = 0;
    for (std::size_t a = 0; a < cell.axes.size(); ++a)
      match += study.cells[i].axes[a].second == cell.axes[a].second ? 1 : 0;
    if (match > best_match)
      best_match = match, seconds = (*results[i])["cell"].value("seconds", guess) * guess /
                                    roughSeconds(study.cells[i]);
  }
  return std::max(seconds, 0.01);
}

StudyOutcome runCells(const Study& study, const std::vector<const StudyCell*>& cells,
                      const StudyRun& run, const Invocation& invocation) {
  return CellRunner(study, run, invocation).run(cells);
}

std::string studyTable(const Study& study, const StudyRun& run) {
  std::vector<std::string> columns;
  std::vector<std::pair<const StudyCell*, std::map<std::string, std::string>>> rows;
  for (const StudyCell& cell : study.cells) {
    std::optional<Json> result = readCell(run, cell);
    if (!result) continue;
    const double seconds = (*result)["cell"].value("seconds", 0.0);
    for (const char* left_out : {"cell", "provenance", "params", "seed"}) result->erase(left_out);
    rows.emplace_back(&cell, std::map<std::string, std::string>{});
    visitNumbers(*result, [&](const std::string& name, const Json& value) {
      if (std::find(columns.begin(), columns.end(), name) == columns.end()) columns.push_back(name);
      rows.back().second[name] = value.dump();
    });
    for (const std::string& axis : study.axes) renameColumn(axis, rows.back().second, columns);
    rows.back().second["seconds"] = fmt::format("{:.3g}", seconds);
  }
  columns.push_back("seconds");
  std::string csv = "id";
  for (const std::string& axis : study.axes) csv += "," + quoteCsv(axis);
  for (const std::string& column : columns) csv += "," + quoteCsv(column);
  csv += "\n";
  for (const auto& [cell, row] : rows) {
    csv += cell->id;
    for (const auto& [name, value] : cell->axes) csv += "," + quoteCsv(value);
    for (const std::string& column : columns) {
      const auto found = row.find(column);
      csv += "," + (found == row.end() ? "" : quoteCsv(found->second));
    }
    csv += "\n";
  }
  return csv;
}

}  // namespace probelab
