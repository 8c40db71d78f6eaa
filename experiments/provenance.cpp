// SPDX-License-Identifier: GPL-3.0-or-later
#include "provenance.h"

#include <nlohmann/json.hpp>

#include "base/build_info.h"
#include "base/parallel.h"
#include "json.h"

namespace probelab {

Provenance makeProvenance(const Invocation& invocation) {
  const BuildInfo build = buildInfo();
  Provenance p;
  p.version = build.version, p.compiler = build.compiler, p.build_type = build.build_type;
  p.command = invocation.command_line;
  p.seed = invocation.common.seed;
  p.threads = threadCount();
  return p;
}

Provenance makeProvenance(const Invocation& invocation, const Scene& scene) {
  Provenance p = makeProvenance(invocation);
  p.scene = scene.name, p.scene_hash = scene.content_hash, p.state = scene.state;
  return p;
}

Json toJson(const Provenance& p) {
  Json json = {{"version", p.version}, {"compiler", p.compiler}, {"build_type", p.build_type},
               {"command", p.command}, {"seed", p.seed},         {"threads", p.threads}};
  const std::pair<const char*, const std::string&> optional[] = {
      {"scene", p.scene},   {"scene_hash", p.scene_hash}, {"state", p.state},
      {"device", p.device}, {"driver", p.driver},         {"tracer", p.tracer}};
  for (const auto& [name, value] : optional)
    if (!value.empty()) json[name] = value;
  return json;
}

std::vector<std::pair<std::string, std::string>> toAttributes(const Provenance& provenance) {
  std::vector<std::pair<std::string, std::string>> attributes;
  const Json json = toJson(provenance);
  for (const auto& [name, value] : json.items())
    attributes.emplace_back("probelab:" + name,
                            value.is_string() ? value.get<std::string>() : value.dump());
  return attributes;
}

}  // namespace probelab
