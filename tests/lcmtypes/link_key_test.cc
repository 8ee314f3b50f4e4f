#include "lcmtypes/link/link_key.h"

#include <fstream>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class LinkKeyTest : public testing::Test {
 protected:
  void SetUp() override { fs::remove(path_); }
  void TearDown() override { fs::remove(path_); }
  std::string fault() {
    try {
      read_link_key(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  const fs::path path_ = fs::path(testing::TempDir()) /
                         (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".key");
};

TEST_F(LinkKeyTest, IsReadBack) {
  const LinkKey key = make_link_key();
  write_link_key(path_, key);
  EXPECT_EQ(read_link_key(path_), key);
  struct stat status {};
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0600u);
}

TEST_F(LinkKeyTest, NoTwoAreAlike) { EXPECT_NE(make_link_key(), make_link_key()); }

TEST_F(LinkKeyTest, AKeyThatOthersCanReadIsRefusedWithTheMend) {
  write_link_key(path_, make_link_key());
  for (const fs::perms wide : {fs::perms::group_read, fs::perms::others_read, fs::perms::group_write}) {
    fs::permissions(path_, fs::perms::owner_read | fs::perms::owner_write | wide);
    EXPECT_NE(fault().find("chmod 600 " + path_.string()), std::string::npos) << fault();
  }
  fs::permissions(path_, fs::perms::owner_read);
  EXPECT_EQ(fault(), "");
}

TEST_F(LinkKeyTest, AKeyIsNeverOverwritten) {
  const LinkKey key = make_link_key();
  write_link_key(path_, key);
  EXPECT_THROW(write_link_key(path_, make_link_key()), InputError);
  EXPECT_EQ(read_link_key(path_), key);
}

TEST_F(LinkKeyTest, WhatIsNoKeyIsNamed) {
  EXPECT_NE(fault().find("vantage-keygen"), std::string::npos) << fault();
  const std::string good = "vantage-key-1 " + std::string(64, 'a') + "\n";
  for (const std::string& text :
       {std::string(), std::string("text\n"), good.substr(1), good + "\n", good.substr(0, good.size() - 1),
        "vantage-key-2" + good.substr(13), "vantage-key-1 " + std::string(63, 'a') + "g\n"}) {
    fs::remove(path_);
    std::ofstream(path_) << text;
    fs::permissions(path_, fs::perms::owner_read | fs::perms::owner_write);
    EXPECT_NE(fault().find("is no key"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace vantage
