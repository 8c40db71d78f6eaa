// SPDX-License-Identifier: GPL-3.0-or-later
#include "proxy_setup.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "table.h"

namespace probelab {
namespace {

RayProxy makeProxy(const Scene& scene, const WallThickness& wall, double asked_m, uint64_t seed) {
  const double thinnest = wall.has_walls ? static_cast<double>(wall.thinnest_m)
                                         : std::numeric_limits<double>::infinity();
  RayProxyOptions options;
  options.max_error_m = proxyErrorBound(asked_m, thinnest);
  options.seed = seed;
  return makeRayProxy(scene, options);
}

std::string formatPoint(const Vec3d& p) {
  return fmt::format("({:.4g}, {:.4g}, {:.4g})", p.x, p.y, p.z);
}

}  // namespace

ProxySetup::ProxySetup(const Scene& scene, const EmbreeScene& scene_embree, double asked,
                       uint64_t seed)
    : asked_m(asked),
      wall(measureWallThickness(scene, scene_embree)),
      proxy(makeProxy(scene, wall, asked, seed)),
      embree(proxy.scene),
      check(checkProxy(scene, scene_embree, proxy.scene, embree,
                       {.bound_m = proxy.report.max_error_m, .seed = seed})) {}

std::unique_ptr<ProxySetup> makeProxySetup(const Scene& scene, const EmbreeScene& embree,
                                           double asked_m, uint64_t seed) {
  if (asked_m == 0) return nullptr;
  auto setup = std::make_unique<ProxySetup>(scene, embree, asked_m, seed);
  if (!setup->check.holds())
    throw Error(
        fmt::format("--ray-proxy {:g}: {} of {} rays that the scene blocks pass its proxy, "
                    "the first from {} to {} m; use a smaller value or none",
                    asked_m, setup->check.leaks, setup->check.blocked,
                    formatPoint(toWorld(scene, setup->check.leak_from)),
                    formatPoint(toWorld(scene, setup->check.leak_to))));
  return setup;
}

Json proxyJson(const ProxySetup* setup) {
  if (setup == nullptr) return nullptr;
  const RayProxyReport& report = setup->proxy.report;
  const ProxyCheck& check = setup->check;
  Json json = {{"asked_m", setup->asked_m},
               {"bound_m", report.max_error_m},
               {"thinnest_wall_m", nullptr},
               {"triangles_before", report.triangles_before},
               {"triangles_after", report.triangles_after},
               {"error_m", std::max(report.original_to_proxy_m, report.proxy_to_original_m)},
               {"leaks", check.leaks},
               {"blocked", check.blocked},
               {"false_walls", check.false_walls},
               {"free", check.free},
               {"hit_p99_m", check.p99_m},
               {"build_s", report.build_s},
               {"left_alone", report.left_alone.size()}};
  if (setup->wall.has_walls) json["thinnest_wall_m"] = setup->wall.thinnest_m;
  return json;
}

std::string formatProxy(const Json& json) {
  const auto number = [&](const char* name) { return formatNumber(json[name].get<double>()); };
  std::string text =
      fmt::format("{} of {} triangles, off by {} m (bound {} m", json["triangles_after"].dump(),
                  json["triangles_before"].dump(), number("error_m"), number("bound_m"));
  if (json["bound_m"].get<double>() < 0.9999 * json["asked_m"].get<double>())
    text += fmt::format(", a quarter of the thinnest wall for the {} asked", number("asked_m"));
  return text + fmt::format("), {} leaks in {} rays, made in {} s", json["leaks"].dump(),
                            json["blocked"].dump(), number("build_s"));
}

}  // namespace probelab
