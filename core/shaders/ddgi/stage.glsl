// SPDX-License-Identifier: Apache-2.0
// What every stage starts with. One invocation an item, in workgroups of 64 along x.
#extension GL_EXT_scalar_block_layout : require

#define BUFFER(index, access, name, declaration) \
  layout(set = 0, binding = index, scalar) access buffer name { declaration; }

const uint kGroupSize = 64u;
layout(local_size_x = 64) in;
