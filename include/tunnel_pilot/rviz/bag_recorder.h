#pragma once

#include <QObject>
#include <QProcess>
#include <QString>
#include <QStringList>

namespace tunnel_pilot::hud {

/// Runs `rosbag record` as a child process, which ends with its parent in whatever way that ends.
class BagRecorder : public QObject {
  Q_OBJECT

 public:
  explicit BagRecorder(QObject* parent = nullptr);
  /// Ends the recording, if there is one, and waits some seconds for the bag to be closed.
  ~BagRecorder() override;

  /// Into a new file of the folder, which is made if need be.
  void start(const QString& folder, const QStringList& topics);
  /// Asks for the end; told() says when the bag is closed.
  void stop();
  bool isRecording() const { return process_.state() != QProcess::NotRunning; }
  const QString& file() const { return file_; }  ///< of the last recording

 Q_SIGNALS:
  /// Something changed: in words, and whether all is well.
  void told(bool good, const QString& words);

 private:
  void onFinished();

  QProcess process_;
  QString file_;
};

}  // namespace tunnel_pilot::hud
