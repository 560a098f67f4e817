// What this process uses of the system.
#pragma once

#include <dirent.h>
#include <unistd.h>

#include <fstream>

#include "../check.hpp"

inline long entries(const char* folder) {
  DIR* opened = opendir(folder);
  CHECK(opened != nullptr);
  long count = 0;
  while (const dirent* entry = readdir(opened)) count += entry->d_name[0] != '.' ? 1 : 0;
  closedir(opened);
  return count;
}

struct Use {
  long resident_kib;
  long handles;
  long threads;
};

inline Use use_now() {
  long pages = 0;
  std::ifstream("/proc/self/statm").ignore(32, ' ') >> pages;
  return {pages * sysconf(_SC_PAGESIZE) / 1024, entries("/proc/self/fd"), entries("/proc/self/task")};
}
