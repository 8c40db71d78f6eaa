// SPDX-License-Identifier: GPL-3.0-or-later
#include "report_figures.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/files.h"
#include "report_studies.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

std::string captionOf(fs::path figure) {
  std::error_code ec;
  figure.replace_extension(".txt");
  if (!fs::exists(figure, ec)) return "";
  std::string text = readTextFile(figure);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text;
}

bool isWhatItsNameSays(const fs::path& path, const std::vector<std::byte>& bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return path.extension() == ".png" ? text.starts_with("\x89PNG\r\n\x1a\n")
                                    : text.find("<svg") != std::string_view::npos;
}

}  // namespace

Json reportFigures(const fs::path& folder, ReportPage& page, const Invocation& invocation) {
  Json figures = Json::array();
  for (const fs::path& path : filesIn(folder, {".png", ".svg"})) {
    fs::path vector = path;
    std::error_code ec;
    if (path.extension() == ".png" && fs::exists(vector.replace_extension(".svg"), ec)) continue;
    const std::vector<std::byte> bytes = readFile(path);
    if (!isWhatItsNameSays(path, bytes)) {
      note(invocation, "{}: left out, it is no {} file; make the figures again", path.string(),
           path.extension() == ".png" ? "PNG" : "SVG");
      continue;
    }
    figures.push_back({{"name", path.stem().string()},
                       {"caption", captionOf(path)},
                       {"type", path.extension() == ".png" ? "image/png" : "image/svg+xml"},
                       {"blob", page.addBlob(bytes, path.string())}});
  }
  return figures;
}

}  // namespace probelab
