#include "offboard/experiment/evaluation_log.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

class Log : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove(path_); }
  void TearDown() override { std::filesystem::remove(path_); }
  std::filesystem::path path_ =
      std::filesystem::path(testing::TempDir()) / ("evaluation_log_test-" + std::to_string(::getpid()));
};

TEST_F(Log, GivesEveryValueBackToTheBit) {
  { EvaluationLog(path_, "head\n").add("all", 0, 1.0 / 3); }
  { EvaluationLog(path_, "head\n").add("object:box", 0, 0.1); }
  const EvaluationLog log(path_, "head\n");
  EXPECT_EQ(log.find("all", 0), 1.0 / 3);
  EXPECT_EQ(log.find("object:box", 0), 0.1);
  EXPECT_FALSE(log.find("all", 1));
}

TEST_F(Log, ALineThatWasCutShortIsAsIfItWereNotThere) {
  { EvaluationLog(path_, "head\n").add("all", 0, 0.5); }
  { EvaluationLog(path_, "head\n").add("all", 1, 0.123456789); }
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 4);
  {
    EvaluationLog log(path_, "head\n");
    EXPECT_EQ(log.find("all", 0), 0.5);
    EXPECT_FALSE(log.find("all", 1)) << "0.12345 would be another value";
    log.add("all", 1, 0.75);
  }
  EXPECT_EQ(EvaluationLog(path_, "head\n").find("all", 1), 0.75);
}

TEST_F(Log, OfOtherSettingsIsRefused) {
  { const EvaluationLog log(path_, "seeds 2\n"); }
  EXPECT_THROW(EvaluationLog(path_, "seeds 3\n"), InputError);
  EXPECT_THROW(EvaluationLog(path_, "seeds 2\nobject box\n"), InputError);
}

}  // namespace
}  // namespace vantage
