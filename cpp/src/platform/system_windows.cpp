// Windows. Texts of the interface are UTF-8 here, too.
#define WIN32_LEAN_AND_MEAN
#define NOMINMAX
#ifndef _WIN32_WINNT  // precompiled headers may have set it
#define _WIN32_WINNT 0x0A00
#endif
#include <windows.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "platform/system.hpp"

namespace endosdk::system {
namespace {

constexpr const wchar_t* runtime_name = L"onnxruntime.dll";
#ifdef _M_ARM64
constexpr const char* crypto_names[] = {"libcrypto-3-arm64.dll", "libcrypto-1_1-arm64.dll"};
#else
constexpr const char* crypto_names[] = {"libcrypto-3-x64.dll", "libcrypto-1_1-x64.dll"};
#endif

std::wstring wide(const std::string& text) {
  const int length = static_cast<int>(text.size());
  std::wstring result(static_cast<size_t>(MultiByteToWideChar(CP_UTF8, 0, text.data(), length, nullptr, 0)), L'\0');
  MultiByteToWideChar(CP_UTF8, 0, text.data(), length, result.data(), static_cast<int>(result.size()));
  return result;
}

std::string narrow(const std::wstring& text) {
  const int length = static_cast<int>(text.size());
  const int size = WideCharToMultiByte(CP_UTF8, 0, text.data(), length, nullptr, 0, nullptr, nullptr);
  std::string result(static_cast<size_t>(size), '\0');
  WideCharToMultiByte(CP_UTF8, 0, text.data(), length, result.data(), size, nullptr, nullptr);
  return result;
}

std::string reason() { return std::system_category().message(static_cast<int>(GetLastError())); }

void add_if_there(const std::filesystem::path& file, std::vector<std::string>& paths) {
  std::error_code unknown;
  if (std::filesystem::exists(file, unknown)) paths.push_back(narrow(file.wstring()));
}

}  // namespace

void* open_library(const std::string& file, std::string& why) {
  // Our worker threads never end, and neither do the runtime's: our own code must stay as long as the process.
  HMODULE own = nullptr;
  constexpr DWORD for_good = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_PIN;
  GetModuleHandleExW(for_good, reinterpret_cast<const wchar_t*>(&open_library), &own);
  // A path also finds what its library needs in the same folder. The working folder is not searched for a bare name.
  std::filesystem::path place = wide(file);
  const bool path = place.has_parent_path();
  if (path) place = std::filesystem::absolute(place).make_preferred();
  std::error_code unknown;
  if (path && std::filesystem::exists(place, unknown) && !std::filesystem::is_regular_file(place, unknown)) {
    why = file + ": no regular file";
    return nullptr;
  }
  const DWORD search = LOAD_LIBRARY_SEARCH_DEFAULT_DIRS | (path ? LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR : 0u);
  HMODULE library = LoadLibraryExW(place.c_str(), nullptr, search);
  if (library == nullptr) why = file + ": " + reason();
  return library;
}

void close_library(void* library) { FreeLibrary(static_cast<HMODULE>(library)); }

bool is_loaded(const std::string& file) { return GetModuleHandleW(wide(file).c_str()) != nullptr; }

void* symbol(void* library, const char* name) {
  return reinterpret_cast<void*>(GetProcAddress(static_cast<HMODULE>(library), name));
}

std::string file_of(const void* address) {
  HMODULE owner = nullptr;
  constexpr DWORD how = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
  if (GetModuleHandleExW(how, static_cast<const wchar_t*>(address), &owner) == 0) return {};
  constexpr DWORD longest = 32768;
  std::wstring path(longest, L'\0');
  const DWORD length = GetModuleFileNameW(owner, path.data(), longest);
  path.resize(length < longest ? length : 0);
  return narrow(path);
}

std::vector<std::string> runtime_places(const std::string& own_folder) {
  std::vector<std::string> paths;
  if (!own_folder.empty()) add_if_there(std::filesystem::path(wide(own_folder)) / runtime_name, paths);
  if (const auto environment = trusted_environment("VIRTUAL_ENV")) {
    add_if_there(std::filesystem::path(wide(*environment)) / "Lib/site-packages/onnxruntime/capi" / runtime_name, paths);
  }
  // No bare name: Windows has an ONNX Runtime of its own, of whatever version.
  return paths;
}

std::vector<std::string> crypto_places() {
  std::vector<std::string> names(std::begin(crypto_names), std::end(crypto_names));
  std::stable_partition(names.begin(), names.end(), is_loaded);
  return names;
}

bool has_raised_privileges() { return false; }  // no file says so, as set-user-ID does elsewhere

std::optional<std::string> trusted_environment(const char* name) {
  std::wstring value(32767, L'\0');
  const DWORD length = GetEnvironmentVariableW(wide(name).c_str(), value.data(), static_cast<DWORD>(value.size()));
  if (length == 0 || length >= value.size()) return std::nullopt;
  value.resize(length);
  return narrow(value);
}

bool set_environment(const char* name, const char* value) { return _putenv_s(name, value) == 0; }

std::optional<std::vector<char>> read_file(const std::string& path, size_t most_bytes, std::string& why) {
  const std::filesystem::path place = wide(path);
  std::error_code error;
  const auto failed = [&](const std::string& reason) {
    why = reason;
    return std::nullopt;
  };
  const auto kind = std::filesystem::status(place, error).type();
  if (kind == std::filesystem::file_type::not_found) return failed("No such file or directory");
  if (kind != std::filesystem::file_type::regular) return failed("no regular file");
  const auto size = std::filesystem::file_size(place, error);
  if (error) return failed(error.message());
  if (size > most_bytes) return failed(too_large(size, most_bytes));
  std::vector<char> bytes(static_cast<size_t>(size));
  std::ifstream file(place, std::ios::binary);
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return failed("cannot be read");
  return bytes;
}

int usable_cores() {
  DWORD_PTR ours = 0;
  DWORD_PTR all = 0;
  if (GetProcessAffinityMask(GetCurrentProcess(), &ours, &all) == 0) return 1;
  int count = 0;
  for (; ours != 0; ours &= ours - 1) ++count;
  return count;
}

bool has_memory(size_t bytes) {
  void* memory = VirtualAlloc(nullptr, bytes, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
  return memory != nullptr && VirtualFree(memory, 0, MEM_RELEASE) != 0;
}

void name_this_thread(const char* name) {
  // From Windows 10 on, and so looked for.
  using SetDescription = HRESULT(WINAPI*)(HANDLE, PCWSTR);
  const auto set = reinterpret_cast<SetDescription>(
      reinterpret_cast<void*>(GetProcAddress(GetModuleHandleA("kernel32.dll"), "SetThreadDescription")));
  if (set != nullptr) set(GetCurrentThread(), std::wstring(name, name + std::strlen(name)).c_str());
}

void block_signals() {}

void with_signals_blocked(const std::function<void()>& start) { start(); }

std::string processor_name() {
  wchar_t name[256] = {};
  DWORD size = sizeof name;
  const wchar_t* key = L"HARDWARE\\DESCRIPTION\\System\\CentralProcessor\\0";
  const LSTATUS status =
      RegGetValueW(HKEY_LOCAL_MACHINE, key, L"ProcessorNameString", RRF_RT_REG_SZ, nullptr, name, &size);
  return status == ERROR_SUCCESS ? narrow(name) : "unknown";
}

bool has_arm_dot_products() {
#ifdef _M_ARM64
  constexpr DWORD dot_products = 43;  // PF_ARM_V82_DP_INSTRUCTIONS_AVAILABLE, which old headers lack
  return IsProcessorFeaturePresent(dot_products) != 0;
#else
  return false;
#endif
}

long process_id() { return static_cast<long>(GetCurrentProcessId()); }

void on_fork(void (*)(), void (*)(), void (*)()) {}  // there is no fork

}  // namespace endosdk::system
