// SPDX-License-Identifier: GPL-3.0-or-later
// Compiling GLSL at run time: includes, defines, error messages, removal of dead code.
#include "gpu/shader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "base/files.h"

namespace probelab {
namespace {

std::string compileError(const ShaderSource& source) {
  try {
    compileShader(source);
  } catch (const Error& error) {
    return error.what();
  }
  return "(no error)";
}

// Whether a name occurs in the module: OpName keeps those of what is left.
bool namesIt(const std::vector<std::uint32_t>& words, const std::string& name) {
  const auto* bytes = reinterpret_cast<const char*>(words.data());
  return std::string_view(bytes, words.size() * 4).find(name) != std::string_view::npos;
}

const std::string kOptional = R"(#version 460
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer Values { float values[]; };
layout(set = 0, binding = 1) buffer Masks { float masks_of_alpha[]; };
float lookUpMask(uint i) { return masks_of_alpha[i]; }
void main() {
  uint i = gl_GlobalInvocationID.x;
  if (WITH_MASKS != 0) values[i] *= lookUpMask(i);
  values[i] += 1;
}
)";

TEST(CompileShader, GivesSpirv16) {
  const auto words = compileShader({"optional", {{"WITH_MASKS", "1"}}, kOptional});
  ASSERT_GT(words.size(), 5u);
  EXPECT_EQ(words[0], 0x07230203u);
  EXPECT_EQ(words[1], 0x00010600u);
}

TEST(CompileShader, LeavesNothingOfAFeatureThatADefineSwitchesOff) {
  const auto with = compileShader({"optional", {{"WITH_MASKS", "1"}}, kOptional});
  const auto without = compileShader({"optional", {{"WITH_MASKS", "0"}}, kOptional});
  EXPECT_TRUE(namesIt(with, "Masks"));
  EXPECT_FALSE(namesIt(without, "Masks"));
  EXPECT_FALSE(namesIt(without, "masks_of_alpha"));
  EXPECT_FALSE(namesIt(without, "lookUpMask"));
  EXPECT_LT(without.size(), with.size());
  // The same module as when the code is not even in the source.
  std::string bare = kOptional;
  for (const std::string line : {"  if (WITH_MASKS != 0) values[i] *= lookUpMask(i);\n",
                                 "float lookUpMask(uint i) { return masks_of_alpha[i]; }\n",
                                 "layout(set = 0, binding = 1) buffer Masks { float "
                                 "masks_of_alpha[]; };\n"})
    bare.erase(bare.find(line), line.size());
  EXPECT_EQ(compileShader({"optional", {}, bare}).size(), without.size());
}

TEST(CompileShader, IsDeterministic) {
  const ShaderSource source{"optional", {{"WITH_MASKS", "1"}}, kOptional};
  EXPECT_EQ(compileShader(source), compileShader(source));
}

TEST(CompileShader, ErrorsNameFileAndLine) {
  const std::string text =
      "#version 460\nlayout(local_size_x = 1) in;\nvoid main() {\n  nope = 1;\n}\n";
  const std::string error = compileError({"ddgi/wrong.comp.glsl", {{"KIND", "3"}}, text});
  EXPECT_NE(error.find("ddgi/wrong.comp.glsl:4: "), std::string::npos) << error;
  EXPECT_NE(error.find("nope"), std::string::npos) << error;
  EXPECT_NE(error.find("KIND=3"), std::string::npos) << error;
}

TEST(CompileShader, ErrorsInAnIncludedFileNameThatFile) {
  // In ray.h, `Ray` becomes an unknown type's member through this macro.
  const std::string text =
      "#version 460\n#extension GL_GOOGLE_include_directive : require\n"
      "#define t_min 7\n#include \"shared/ray.h\"\nvoid main() {}\n";
  const std::string error = compileError({"wrong.comp.glsl", {}, text});
  EXPECT_NE(error.find("shared/ray.h:"), std::string::npos) << error;
}

TEST(CompileShader, LinesAfterAnIncludeAreCountedInTheIncludingFile) {
  const std::string text =
      "#version 460\n#extension GL_GOOGLE_include_directive : require\n"
      "#include \"shared/ray.h\"\nvoid main() { nope(); }\n";
  const std::string error = compileError({"wrong.comp.glsl", {}, text});
  EXPECT_NE(error.find("wrong.comp.glsl:4: "), std::string::npos) << error;
}

TEST(CompileShader, AMissingIncludeIsNamed) {
  const std::string text = "#version 460\n#include \"shared/nothing.h\"\nvoid main() {}\n";
  const std::string error = compileError({"wrong.comp.glsl", {}, text});
  EXPECT_NE(error.find("shared/nothing.h"), std::string::npos) << error;
  EXPECT_NE(error.find("wrong.comp.glsl:2"), std::string::npos) << error;
}

TEST(CompileShader, AMissingFileIsAnInputErrorThatSuggestsOne) {
  EXPECT_THROW(compileShader({"shared/rey.h", {}, {}}), InputError);
  EXPECT_NE(compileError({"shared/rey.h", {}, {}}).find("'shared/ray.h'"), std::string::npos);
}

TEST(EmbeddedShaders, AreTheFilesByteForByte) {
  const std::string root = std::string(PROBELAB_SOURCE_DIR) + "/core/shaders/";
  const std::vector<std::string> names = shaderFiles();
  EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
  EXPECT_TRUE(std::find(names.begin(), names.end(), "shared/ray.h") != names.end());
  for (const std::string& name : names)
    EXPECT_TRUE(shaderText(name) == readTextFile(root + name)) << name;
}

}  // namespace
}  // namespace probelab
