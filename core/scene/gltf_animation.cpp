// SPDX-License-Identifier: Apache-2.0
// Node animation at one time [glTF 2.0, section 3.11 and appendix C].
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "base/error.h"
#include "gltf_accessor.h"
#include "gltf_nodes.h"

namespace probelab {
namespace {

using Quad = std::array<double, 4>;  // a translation or scale uses three

struct Channel {
  std::vector<float> times;   // ascending
  std::vector<float> values;  // [key][component], cubic: [key][in, value, out][component]
  int components = 3;
  bool cubic = false, step = false;

  // `part`: 0 in-tangent, 1 value, 2 out-tangent.
  Quad key(std::size_t k, int part = 1) const {
    const std::size_t row = cubic ? 3 * k + part : k;
    Quad result{};
    for (int c = 0; c < components; ++c) result[c] = values[row * components + c];
    return result;
  }
};

Quad normalized(Quad q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& c : q) c /= norm;
  return q;
}

// Along the shorter arc.
Quad slerp(const Quad& from, Quad to, double t) {
  const Quad a = normalized(from);
  to = normalized(to);
  double cosine = a[0] * to[0] + a[1] * to[1] + a[2] * to[2] + a[3] * to[3];
  if (cosine < 0) {
    cosine = -cosine;
    for (double& c : to) c = -c;
  }
  const double angle = std::acos(std::min(cosine, 1.0)), sine = std::sin(angle);
  // Below this angle the weights' limit, 1 - t and t, is exact in double precision.
  const bool close = sine < 1e-8;
  const double wa = close ? 1 - t : std::sin((1 - t) * angle) / sine;
  const double wb = close ? t : std::sin(t * angle) / sine;
  Quad result;
  for (int c = 0; c < 4; ++c) result[c] = wa * a[c] + wb * to[c];
  return normalized(result);
}

// Hermite spline; tangents are per second [appendix C.5].
Quad cubic(const Channel& channel, std::size_t k, double t, double dt) {
  const Quad v0 = channel.key(k), b0 = channel.key(k, 2);
  const Quad v1 = channel.key(k + 1), a1 = channel.key(k + 1, 0);
  const double t2 = t * t, t3 = t2 * t;
  Quad result{};
  for (int c = 0; c < channel.components; ++c)
    result[c] = (2 * t3 - 3 * t2 + 1) * v0[c] + dt * (t3 - 2 * t2 + t) * b0[c] +
                (-2 * t3 + 3 * t2) * v1[c] + dt * (t3 - t2) * a1[c];
  return result;
}

Quad sample(const Channel& channel, double time_s) {
  const std::vector<float>& times = channel.times;
  if (time_s <= times.front()) return channel.key(0);
  if (time_s >= times.back()) return channel.key(times.size() - 1);
  const auto next = std::upper_bound(times.begin(), times.end(), time_s);
  const std::size_t k = next - times.begin() - 1;
  if (channel.step) return channel.key(k);
  const double dt = static_cast<double>(times[k + 1]) - times[k], t = (time_s - times[k]) / dt;
  if (channel.cubic) return cubic(channel, k, t, dt);
  if (channel.components == 4) return slerp(channel.key(k), channel.key(k + 1), t);
  const Quad a = channel.key(k), b = channel.key(k + 1);
  Quad result{};
  for (int c = 0; c < 3; ++c) result[c] = (1 - t) * a[c] + t * b[c];
  return result;
}

Channel readChannel(const GltfFile& gltf, const tinygltf::AnimationSampler& sampler, int components,
                    const std::string& element) {
  Channel channel;
  channel.components = components;
  channel.step = sampler.interpolation == "STEP";
  channel.cubic = sampler.interpolation == "CUBICSPLINE";
  if (!channel.step && !channel.cubic && sampler.interpolation != "LINEAR")
    throwInput("{}: {}: interpolation '{}' is none of STEP, LINEAR, CUBICSPLINE", gltf.path,
               element, printable(sampler.interpolation));
  channel.times = readFloats(gltf, sampler.input, 1, element + ", input");
  channel.values = readFloats(gltf, sampler.output, components, element + ", output");
  const std::vector<float>& times = channel.times;
  if (times.empty()) throwInput("{}: {}: has no keys", gltf.path, element);
  if (std::adjacent_find(times.begin(), times.end(), std::greater_equal<>()) != times.end())
    throwInput("{}: {}: its times are not strictly ascending", gltf.path, element);
  const std::size_t rows = times.size() * (channel.cubic ? 3 : 1);
  if (channel.values.size() != rows * components)
    throwInput("{}: {}: has {} keys and {} values", gltf.path, element, times.size(),
               channel.values.size() / components);
  return channel;
}

void apply(const std::string& path, const Quad& value, NodeTrs& trs) {
  if (path == "translation") trs.translation = {value[0], value[1], value[2]};
  if (path == "scale") trs.scale = {value[0], value[1], value[2]};
  if (path == "rotation") trs.rotation = {value[0], value[1], value[2], value[3]};
}

}  // namespace

void animate(const GltfFile& gltf, double time_s, std::vector<NodeTrs>& nodes,
             std::vector<bool>& animated, Warnings& warnings) {
  std::set<std::pair<int, std::string>> moved;
  for (std::size_t i = 0; i < gltf.model.animations.size(); ++i) {
    const tinygltf::Animation& animation = gltf.model.animations[i];
    const std::string name = elementName("animation", i, animation.name);
    for (const tinygltf::AnimationChannel& channel : animation.channels) {
      const std::string& path = channel.target_path;
      if (path != "translation" && path != "rotation" && path != "scale") {
        warnings.add("{}: {}: animates '{}', which is ignored", gltf.path, name, printable(path));
        continue;
      }
      if (channel.target_node < 0) continue;
      const std::string element =
          fmt::format("{}, {} of {}", name, path, nodeName(gltf, channel.target_node));
      if (channel.sampler < 0 ||
          static_cast<std::size_t>(channel.sampler) >= animation.samplers.size())
        throwInput("{}: {}: names sampler {}, there are {}", gltf.path, element, channel.sampler,
                   animation.samplers.size());
      if (!moved.insert({channel.target_node, path}).second) {
        warnings.add("{}: {}: a second animation of the same is ignored", gltf.path, element);
        continue;
      }
      const Channel keys = readChannel(gltf, animation.samplers[channel.sampler],
                                       path == "rotation" ? 4 : 3, element);
      apply(path, sample(keys, time_s), nodes[channel.target_node]);
      animated[channel.target_node] = true;
    }
  }
}

}  // namespace probelab
