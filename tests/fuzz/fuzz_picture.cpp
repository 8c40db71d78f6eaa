// SPDX-License-Identifier: GPL-3.0-or-later
// A texture: PNG or JPEG in memory.
#include "fuzz.h"
#include "image_decode.h"

void probelab::fuzz::runPicture(Bytes bytes) {
  std::string why;
  const std::optional<Texture> texture = decodeImage(bytes, why);
  if (!texture && why.empty()) throw Error("refused without a reason");
}
