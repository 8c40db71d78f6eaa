// SPDX-License-Identifier: Apache-2.0
#include "gltf_file.h"

#include <cstring>
#include <limits>
#include <new>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "gltf_check.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;

struct Chunks {
  bool glb = false;
  std::string_view json;
  std::size_t bin_bytes = 0;
};

uint32_t readU32(std::span<const std::byte> bytes, std::size_t offset) {
  uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | std::to_integer<uint32_t>(bytes[offset + i]);
  return value;
}

std::string_view asText(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// The chunk at `offset`; its payload must lie inside `bytes`.
std::span<const std::byte> chunkAt(const std::string& file, std::span<const std::byte> bytes,
                                   std::size_t offset, uint32_t& type) {
  if (bytes.size() - offset < kChunkHeaderBytes)
    throwInput("{}: the GLB ends inside a chunk's header; it is truncated", file);
  const std::size_t length = readU32(bytes, offset);
  type = readU32(bytes, offset + 4);
  if (length > bytes.size() - offset - kChunkHeaderBytes)
    throwInput("{}: a GLB chunk says {} bytes, {} are left; it is truncated", file, length,
               bytes.size() - offset - kChunkHeaderBytes);
  return bytes.subspan(offset + kChunkHeaderBytes, length);
}

Chunks splitGlb(const std::string& file, std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes) throwInput("{}: the GLB ends inside its header", file);
  if (readU32(bytes, 4) != 2)
    throwInput("{}: is GLB version {}; version 2 is read", file, readU32(bytes, 4));
  const std::size_t length = readU32(bytes, 8);
  if (length > bytes.size())
    throwInput("{}: the GLB says {} bytes, the file has {}; it is truncated", file, length,
               bytes.size());
  if (length < kHeaderBytes) throwInput("{}: the GLB says it has {} bytes", file, length);
  bytes = bytes.first(length);
  Chunks chunks;
  chunks.glb = true;
  uint32_t type = 0;
  const std::span<const std::byte> json = chunkAt(file, bytes, kHeaderBytes, type);
  if (type != kJsonChunk) throwInput("{}: the GLB's first chunk is not JSON", file);
  chunks.json = asText(json);
  const std::size_t next = kHeaderBytes + kChunkHeaderBytes + json.size();
  if (next % 4 != 0) throwInput("{}: the GLB's JSON chunk is not a multiple of 4 bytes long", file);
  if (next == bytes.size()) return chunks;
  const std::span<const std::byte> bin = chunkAt(file, bytes, next, type);
  if (type == kBinChunk) chunks.bin_bytes = bin.size();
  return chunks;
}

Chunks splitFile(const std::string& file, std::span<const std::byte> bytes) {
  if (asText(bytes).starts_with("glTF")) return splitGlb(file, bytes);
  Chunks chunks;
  chunks.json = asText(bytes);
  return chunks;
}

FileGuard& guardOf(void* user) { return *static_cast<FileGuard*>(user); }

tinygltf::FsCallbacks guardedFiles(FileGuard& guard) {
  tinygltf::FsCallbacks callbacks{};
  callbacks.FileExists = [](const std::string& path, void* user) {
    return guardOf(user).allows(path);
  };
  // No expansion: a path is a path, whatever a shell would make of it.
  callbacks.ExpandFilePath = [](const std::string& path, void*) { return path; };
  callbacks.ReadWholeFile = [](std::vector<unsigned char>* out, std::string*,
                               const std::string& path, void* user) {
    *out = guardOf(user).read(path);
    return true;
  };
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                                void*) { return false; };
  callbacks.user_data = &guard;
  return callbacks;
}

// Keeps the encoded bytes; images.h decodes what a material uses.
bool keepEncoded(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                 const unsigned char* bytes, int size, void*) {
  if (size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

tinygltf::Model parse(const std::string& file, std::span<const std::byte> bytes, bool glb,
                      FileGuard& guard) {
  tinygltf::TinyGLTF reader;
  reader.SetFsCallbacks(guardedFiles(guard));
  reader.SetImageLoader(keepEncoded, nullptr);
  tinygltf::Model model;
  std::string errors, remarks;
  bool done = false;
  const auto size = static_cast<unsigned int>(bytes.size());
  try {
    const std::string folder = guard.folder().string();
    done = glb ? reader.LoadBinaryFromMemory(&model, &errors, &remarks,
                                             reinterpret_cast<const unsigned char*>(bytes.data()),
                                             size, folder, tinygltf::REQUIRE_VERSION)
               : reader.LoadASCIIFromString(&model, &errors, &remarks,
                                            reinterpret_cast<const char*>(bytes.data()), size,
                                            folder, tinygltf::REQUIRE_VERSION);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;  // not the file's fault
  } catch (const std::exception& e) {
    throwInput("{}: cannot be parsed: {}", file, printable(e.what()));
  }
  // Remarks on what it loads all the same do not count: checkGltfStructure was stricter, and it
  // also complains of valid files, as of skins without inverse bind matrices.
  if (!done) {
    while (!errors.empty() && errors.back() == '\n') errors.pop_back();
    // Caught in there; the whole of the text, for a file may say the same within it.
    if (errors == std::bad_alloc().what()) throw std::bad_alloc();
    if (errors.empty()) errors = "the reader gives no reason; a key has a value of the wrong type";
    throwInput("{}: cannot be parsed: {}", file, printable(errors));
  }
  return model;
}

}  // namespace

GltfFile readGltf(const fs::path& path, Warnings& warnings) {
  GltfFile result;
  result.path = path.string();
  const std::vector<std::byte> bytes = readFile(path);
  result.hashes.push_back(contentHash(bytes));
  if (bytes.size() > std::numeric_limits<uint32_t>::max())
    throwInput("{}: is larger than 4 GB; split it", result.path);
  const Chunks chunks = splitFile(result.path, bytes);
  const nlohmann::json root = parseGltfJson(result.path, chunks.json);
  checkGltfStructure(result.path, root);
  checkGltfExtensions(result.path, root, warnings);
  FileGuard guard(path);
  checkGltfBuffers(result.path, root, chunks.glb, chunks.bin_bytes, guard);
  result.model = parse(result.path, bytes, chunks.glb, guard);
  for (const std::string& hash : guard.hashes()) result.hashes.push_back(hash);
  return result;
}

}  // namespace probelab
