#pragma once

#include <filesystem>

#include <gtest/gtest.h>

namespace vantage {

/// A test with an empty folder of its own.
class LogFolder : public testing::Test {
 protected:
  void SetUp() override {
    const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / (std::string(test->test_suite_name()) + "_" + test->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    log_ = folder_ / "log.lcm";
  }

  std::filesystem::path folder_, log_;
};

}  // namespace vantage
