// SPDX-License-Identifier: Apache-2.0
// Channel names in an EXR file: "layer.channel", or "channel" in the main layer.
#pragma once

#include <string>

namespace probelab {

struct ExrChannelName {
  std::string layer, channel;
};

inline ExrChannelName splitExrName(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos) return {"", name};
  return {name.substr(0, dot), name.substr(dot + 1)};
}

inline std::string joinExrName(const std::string& layer, const std::string& channel) {
  return layer.empty() ? channel : layer + "." + channel;
}

}  // namespace probelab
