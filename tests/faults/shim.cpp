// SPDX-License-Identifier: GPL-3.0-or-later
// A library that the fault tests preload (LD_PRELOAD): it stands between the program and the Vulkan
// loader, or the program and the C++ heap, and makes one call fail. The program knows nothing of
// it.
//
//   FAULT_CALL=vkQueueSubmit2 FAULT_AFTER=5 FAULT_RESULT=-4   the sixth call returns -4; so do all
//                                                             later ones, and waits, for -4 (lost)
//   FAULT_RESULT=crash                                        the call is a segmentation fault
//   FAULT_CALL=new FAULT_AFTER=100                            the 101st operator new throws
//   bad_alloc,
//                                                             counted from installing the signal
//                                                             handler
//   FAULT_HIDE=VK_KHR_ray_query                               no device has this extension
//   FAULT_OPENED=file                                         the paths of all files that are
//   opened FAULT_COUNT=file                                          how often the call was made,
//   at exit
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <vulkan/vulkan.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>
#include <vector>

namespace {

const char* text(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}
long number(const char* name) { return std::atol(text(name)); }

std::atomic<long> calls{0};
std::atomic<bool> lost{false}, armed{false};

struct CountAtExit {
  ~CountAtExit() {
    if (*text("FAULT_COUNT") == 0) return;
    if (std::FILE* file = std::fopen(text("FAULT_COUNT"), "w")) {
      std::fprintf(file, "%ld\n", calls.load());
      std::fclose(file);
    }
  }
} count_at_exit;

// What the call is to return: VK_SUCCESS where it is to be made as usual.
VkResult fault(const char* call) {
  if (lost) return VK_ERROR_DEVICE_LOST;
  if (std::string_view(text("FAULT_CALL")) != call) return VK_SUCCESS;
  if (calls++ < number("FAULT_AFTER") || *text("FAULT_AFTER") == 0) return VK_SUCCESS;
  if (std::string_view(text("FAULT_RESULT")) == "crash") std::raise(SIGSEGV);
  const auto result = static_cast<VkResult>(number("FAULT_RESULT"));
  if (result == VK_ERROR_DEVICE_LOST) lost = true;
  return result;
}

template <class Function>
Function next(Function, const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

// A call that does not take place when it fails.
#define PROBELAB_FAIL(call, parameters, arguments)            \
  extern "C" VKAPI_ATTR VkResult VKAPI_CALL call parameters { \
    static const auto real = next(call, #call);               \
    const VkResult result = fault(#call);                     \
    return result == VK_SUCCESS ? real arguments : result;    \
  }

PROBELAB_FAIL(vkQueueSubmit2,
              (VkQueue queue, uint32_t count, const VkSubmitInfo2* submits, VkFence fence),
              (queue, count, submits, fence))
PROBELAB_FAIL(vkAllocateMemory,
              (VkDevice device, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks* a,
               VkDeviceMemory* memory),
              (device, info, a, memory))
PROBELAB_FAIL(vkMapMemory,
              (VkDevice device, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
               VkMemoryMapFlags flags, void** data),
              (device, memory, offset, size, flags, data))
PROBELAB_FAIL(vkCreateComputePipelines,
              (VkDevice device, VkPipelineCache cache, uint32_t count,
               const VkComputePipelineCreateInfo* infos, const VkAllocationCallbacks* a,
               VkPipeline* pipelines),
              (device, cache, count, infos, a, pipelines))
PROBELAB_FAIL(vkCreateDevice,
              (VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
               const VkAllocationCallbacks* a, VkDevice* device),
              (physical, info, a, device))

// The work is let to end first: what a driver runs on must not be freed under it.
extern "C" VKAPI_ATTR VkResult VKAPI_CALL vkWaitForFences(VkDevice device, uint32_t count,
                                                          const VkFence* fences, VkBool32 all,
                                                          uint64_t timeout) {
  static const auto real = next(vkWaitForFences, "vkWaitForFences");
  if (lost) return VK_ERROR_DEVICE_LOST;
  const VkResult done = real(device, count, fences, all, timeout);
  const VkResult result = fault("vkWaitForFences");
  return result == VK_SUCCESS ? done : result;
}

extern "C" VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateDeviceExtensionProperties(
    VkPhysicalDevice device, const char* layer, uint32_t* count, VkExtensionProperties* out) {
  static const auto real =
      next(vkEnumerateDeviceExtensionProperties, "vkEnumerateDeviceExtensionProperties");
  uint32_t all = 0;
  if (const VkResult result = real(device, layer, &all, nullptr); result != VK_SUCCESS)
    return result;
  std::vector<VkExtensionProperties> extensions(all);
  if (const VkResult result = real(device, layer, &all, extensions.data()); result != VK_SUCCESS)
    return result;
  std::erase_if(extensions, [](const VkExtensionProperties& e) {
    return std::strcmp(e.extensionName, text("FAULT_HIDE")) == 0;
  });
  const auto kept = static_cast<uint32_t>(extensions.size());
  if (!out) {
    *count = kept;
    return VK_SUCCESS;
  }
  const uint32_t given = std::min(*count, kept);
  std::copy_n(extensions.begin(), given, out);
  *count = given;
  return given < kept ? VK_INCOMPLETE : VK_SUCCESS;
}

// Appends a path to the list of opened files, by calls that do not come here again.
static void noteOpened(const char* path) {
  if (*text("FAULT_OPENED") == 0 || path == nullptr) return;
  const auto list = syscall(SYS_openat, AT_FDCWD, text("FAULT_OPENED"),
                            O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const int file = static_cast<int>(list);
  if (file < 0) return;
  dprintf(file, "%s\n", path);
  close(file);
}

#define PROBELAB_NOTE_FOPEN(name)                                  \
  extern "C" std::FILE* name(const char* path, const char* mode) { \
    static const auto real = next(name, #name);                    \
    noteOpened(path);                                              \
    return real(path, mode);                                       \
  }
PROBELAB_NOTE_FOPEN(fopen)
PROBELAB_NOTE_FOPEN(fopen64)

#define PROBELAB_NOTE_OPEN(name)                                                      \
  extern "C" int name(const char* path, int flags, ...) {                             \
    static const auto real = next(name, #name);                                       \
    va_list rest;                                                                     \
    va_start(rest, flags);                                                            \
    const unsigned mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, unsigned) : 0; \
    va_end(rest);                                                                     \
    noteOpened(path);                                                                 \
    return real(path, flags, mode);                                                   \
  }
PROBELAB_NOTE_OPEN(open)
PROBELAB_NOTE_OPEN(open64)

// The program installs its handler before it starts on a command; options are read by then.
extern "C" sighandler_t signal(int number, sighandler_t handler) noexcept {
  static const auto real = next(signal, "signal");
  armed = true;
  return real(number, handler);
}

void* operator new(std::size_t size) {
  if (armed && std::strcmp(text("FAULT_CALL"), "new") == 0) {
    const long at = number("FAULT_AFTER");
    if (calls++ == at && *text("FAULT_AFTER") != 0) throw std::bad_alloc();
  }
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
